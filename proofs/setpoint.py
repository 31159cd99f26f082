"""What to set for a wanted speed: `python -m proofs.setpoint [RUNS [WORLD ...]]`.

The robot's process writes recordings (3 s standing, 100 s sweep, 300 s of random commands);
`Twin.run` follows each with `twins/robot1d.toml`. Then the inverse of the live version's map is
asked, as `evertwin setpoint` does, for every whole speed from 1 to 20 cm/s, and the true drive is
given the set-point: how far is its settled speed from the one wanted? Beside it the model as
configured, which sets what is wanted. Speeds that the true drive cannot have (below its start
threshold, above its cap) must be refused, and no other. Asked: of the speeds that can be had 90 %
within 0.5 cm/s; at least 95 % of the answers right about what can be had; the true speed inside the
interval in 95 %, as far as chance lets it be counted.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin.ahead.inverse import inverse
from evertwin.worlds.drive import WORLDS, target
from planted.robots import recordings
from planted.twins import opened
from proofs._verdict import chance, ended

WANTED = np.arange(1.0, 21.0)
"""[cm/s]"""
OFF, EDGE = 0.5, 0.3
"""Error that is asked for, and how near the edge of what can be had no answer is counted [cm/s]."""


def can(world: str) -> np.ndarray:
    """Which speeds the true drive can have: 1, 0; at an edge NaN."""
    drive = WORLDS[world][0]
    fine = np.linspace(0.0, 20.0, 20_001)
    reached = np.sort(target(drive, fine))
    near = np.array([np.abs(reached - one).min() for one in WANTED])
    edges = np.array([drive.start if drive.clamp else drive.slope * drive.start + drive.offset,
                      min(drive.cap, reached[-1])])  # fmt: skip
    edge = np.abs(WANTED[:, None] - edges).min(axis=1) < EDGE
    return np.where(edge, np.nan, (near < 0.01).astype(np.float64))


def main() -> int:
    """Exit code 0 if everything asked was reached."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 25
    demands: dict[str, bool] = {}
    with tempfile.TemporaryDirectory() as folder:
        for world in sys.argv[2:] or WORLDS:
            drive, possible = WORLDS[world][0], can(world)
            right, errors, inside = 0, [], 0
            for name in recordings(Path(folder), world, runs, 300):
                with opened("robot1d") as twin:
                    twin.run(name)
                    found = inverse(
                        twin.prospect(None, name).basis, WANTED / 100, "m/s", ("", ""), name
                    )
                for wanted, could, one in zip(WANTED, possible, found.answers, strict=True):
                    if np.isnan(could):
                        continue
                    right += (one.set_point is not None) == bool(could)
                    if could and one.set_point is not None:
                        true = float(target(drive, np.array([100 * one.set_point]))[0])
                        errors.append(abs(true - wanted))
                        inside += 100 * one.gives95[0] <= true <= 100 * one.gives95[1]
            asked = runs * int(np.isfinite(possible).sum())
            plain = np.abs(target(drive, WANTED) - WANTED)[possible == 1]
            kept = inside / len(errors)
            print(
                f"{world}: right about what can be had {right} of {asked}; off by median "
                f"{np.median(errors):.2f}, 90 % below {np.quantile(errors, 0.9):.2f}, at most "
                f"{np.max(errors):.2f} cm/s over {len(errors)}; inside the interval {kept:.3f}; "
                f"as configured {np.median(plain):.2f}, at most {plain.max():.2f} cm/s, and it "
                f"refuses nothing",
                flush=True,
            )
            demands |= {
                f"{world}: 90 % within {OFF} cm/s": bool(np.quantile(errors, 0.9) <= OFF),
                f"{world}: what can be had": right >= 0.95 * asked,
                f"{world}: intervals": bool(kept >= 0.95 - chance(0.95, len(errors))),
            }
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
