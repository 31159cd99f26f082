"""Right and wrong promotions: `python -m proofs.mrclam6 [ROBOT ...]` (needs EVERTWIN_DATA).

Five iRobot Create, commanded v and w against motion capture (UTIAS MRCLAM 6; Leung et al., 2011).
Each recording through `Twin.run` with `twins/mrclam6.toml`: what was promoted, when, on what
evidence.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from planted.twins import opened
from proofs._verdict import no_data

LAG, COUPLING, TABLE = ("lag", "*", ""), ("coupling", "v", "w"), ("table", "w", "")


def ran(robot: int) -> set[tuple[str, str, str]]:
    """Kinds and channels of the champion's terms after the whole recording."""
    folder = Path(os.environ["EVERTWIN_DATA"]) / "mrclam6"
    files = [folder / f"Robot{robot}_{kind}.dat.gz" for kind in ("Odometry", "Groundtruth")]
    with opened("mrclam6") as twin:
        result = twin.run(files)
    for event in result.of_kind("corrected", "promoted", "rolled_back"):
        print(f"  {event.time * 1e-9:6.0f} s  {event.kind}: {event.reason}")
    return {(t.kind, t.channel, t.source) for t in result.champion.form.terms}


def main(robots: list[int]) -> int:
    """Exit code 1 if a lag is missing, a table of w is there, or too few couplings."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    found = []
    for robot in robots:
        print(f"robot {robot}", flush=True)
        found.append(ran(robot))
    n, (lags, couplings, tables) = len(robots), (
        sum(term in terms for terms in found) for term in (LAG, COUPLING, TABLE)
    )  # fmt: skip
    print(
        f"lag promoted on {lags} of {n}, coupling of v to w on {couplings} of {n}, tables of w on "
        f"{tables} of {n}"
    )
    return 0 if lags == n and tables == 0 and couplings >= 0.8 * n else 1


if __name__ == "__main__":
    sys.exit(main([int(a) for a in sys.argv[1:]] or [1, 2, 3, 4, 5]))
