"""Right and wrong promotions: `python -m proofs.mrclam6 [ROBOT ...]` (needs EVERTWIN_DATA).

Five iRobot Create, commanded v and w against motion capture (UTIAS MRCLAM 6; Leung et al., 2011).

1. Each recording through `Twin.run` with one twin file: what was promoted, when, on what evidence.
2. The same search on the first half alone; held-out gain of every kind that was tried first.
3. Negative control: a table of the turn rate on top of the lag, learned on the first half, on the
   second. Change of the heading's mean absolute error over 2 s; positive is worse.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from evertwin import Twin
from evertwin.correction.candidates import propose
from evertwin.correction.evidence import gather
from evertwin.correction.fitting import fit_candidate
from evertwin.correction.improve import Selection, improve, stack_of
from evertwin.fold import Block, take
from evertwin.machines.mobile import Differential
from evertwin.models.corrected import build
from evertwin.models.form import Form, Term
from evertwin.models.terms.rows import Rows

TWIN = Path(__file__).parent.parent / "twins" / "mrclam6.toml"
HORIZON = 2.0
LAG, COUPLING = ("lag", "*", ""), ("coupling", "v", "w")


def short(terms: tuple[Term, ...]) -> set[tuple[str, str, str]]:
    """Kinds and channels."""
    return {(t.kind, t.channel, t.source) for t in terms}


def ran(robot: int) -> tuple[set[tuple[str, str, str]], tuple[Block, ...]]:
    """Terms of the champion after the whole recording, and the recording's rows."""
    folder = Path(os.environ["EVERTWIN_DATA"]) / "mrclam6"
    files = [folder / f"Robot{robot}_{kind}.dat.gz" for kind in ("Odometry", "Groundtruth")]
    with Twin.open(TWIN) as twin:
        result = twin.run(files)
        for event in twin.events:
            if event.kind in ("corrected", "promoted", "rolled_back"):
                sys.stdout.write(f"  {event.time * 1e-9:6.0f} s  {event.kind}: {event.reason}\n")
        for name in ("x", "y", "heading"):
            out = result.outputs[name]
            sys.stdout.write(
                f"  {name}: rms over the horizon {out.rms_before:.4g} → {out.rms_after:.4g}"
                f" {out.unit}\n"
            )
        return short(twin.champion.form.terms), twin.blocks(files)


def halves(rows: tuple[Block, ...]) -> tuple[list[Block], list[Block]]:
    """The rows before and after the middle."""
    middle = sum(len(b.t) for b in rows) // 2
    first, second, seen = [], [], 0
    for block in rows:
        cut = min(max(middle - seen, 0), len(block.t))
        first += [take(block, 0, cut)] if cut else []
        second += [take(block, cut, len(block.t))] if cut < len(block.t) else []
        seen += len(block.t)
    return first, second


def table_on_turn_rate(train: list[Block], test: list[Block]) -> float:
    """Change of the heading's error on unseen rows by a table on top of the lag."""
    base = Differential()
    settings = Selection(kinds=("lag",))
    lag = improve(base, Form(), train, HORIZON, settings)
    known = gather(base, train, HORIZON)
    errors = []
    from_lag = build(base, lag.form)
    table = propose(Rows(base, train, ("w",), HORIZON), ("table",))[0]
    scored = fit_candidate(stack_of(base, lag.form, lag.p), table, known)
    for model, p in ((from_lag, lag.p), (scored.stack.model, scored.stack.p)):
        seen = gather(model, test, HORIZON, known.scale, p)
        errors.append(float(np.abs(seen.residual(model, p)[:, 2]).mean()))
    return errors[1] / errors[0] - 1.0


def main(robots: list[int]) -> int:
    """Exit code 1 if a lag is missing, a table of w is there, or too few couplings."""
    lags = couplings = tables = 0
    for robot in robots:
        sys.stdout.write(f"robot {robot}\n")
        terms, rows = ran(robot)
        lags += LAG in terms
        couplings += COUPLING in terms
        tables += ("table", "w", "") in terms
        train, test = halves(rows)
        found = improve(Differential(), Form(), train, HORIZON, Selection())
        sys.stdout.write(f"  first half alone: {'; '.join(found.describes)}\n")
        for gain in found.steps:
            sys.stdout.write(f"    {100 * gain.gain:5.1f} %  {gain.detail}\n")
        change = table_on_turn_rate(train, test)
        sys.stdout.write(f"  table of w on the lag, second half: {100 * change:+.1f} %\n")
    n = len(robots)
    sys.stdout.write(
        f"lag promoted on {lags} of {n}, coupling of v to w on {couplings} of {n}, "
        f"tables of w on {tables} of {n}\n"
    )
    return 0 if lags == n and tables == 0 and couplings >= 0.8 * n else 1


if __name__ == "__main__":
    sys.exit(main([int(a) for a in sys.argv[1:]] or [1, 2, 3, 4, 5]))
