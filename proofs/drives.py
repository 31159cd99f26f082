"""Two real skid-steered bases: `python -m proofs.drives` (needs EVERTWIN_DATA).

Clearpath Husky and Warthog (Baril et al., arXiv:2309.10718), windows of 2 s at random wheel
commands, with `twins/drive_husky.toml` and `twins/drive_warthog.toml` as they are: steady windows,
predicted from their start to their end. Figures are mean absolute errors of the way over a window
of the odd calibration steps: the length of its path, with the sign of its mean forward speed.
`Twin.run` goes over the even steps; its live version, frozen, is judged on the odd ones.

Asked: at most 0.17 m (Husky) and 0.18 m (Warthog) by the live version.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin import Model
from evertwin.fold import Block
from evertwin.models.corrected.corrected import build
from planted.twins import opened
from proofs._verdict import ended, no_data

ASKED = {"husky": 0.17, "warthog": 0.18}
SAID = ("corrected", "promoted", "rejected", "rolled_back", "undecided")
ROWS = 40


def recording(robot: str, name: str) -> Path:
    """A file of a robot."""
    return Path(os.environ["EVERTWIN_DATA"]) / f"drive_{robot}" / f"{robot}_{name}.csv"


def steps(robot: str, folder: Path, odd: int) -> Path:
    """The rows of even or of odd calibration steps."""
    head, *rows = recording(robot, "windows").read_text(encoding="utf-8").splitlines()
    column = head.split(",").index("calib_step")
    kept = [row for row in rows if int(float(row.split(",")[column])) % 2 == odd]
    out = folder / f"steps{odd}.csv"
    out.write_text("\n".join([head, *kept]), encoding="utf-8")
    return out


def ways(robot: str) -> np.ndarray:
    """The way of every steady window of odd steps [m]."""
    rows, summary = (
        np.genfromtxt(recording(robot, name), delimiter=",", names=True)
        for name in ("windows", "window_summary")
    )
    x, y = (rows[name].reshape(len(summary), ROWS) for name in ("icp_x", "icp_y"))
    way = np.hypot(np.diff(x, axis=1), np.diff(y, axis=1)).sum(axis=1) * np.sign(summary["icp_vx"])
    return way[(summary["steady_state_mask"] > 0) & (summary["calib_step"] % 2 == 1)]


def error(model: Model, p: np.ndarray, windows: tuple[Block, ...], way: np.ndarray) -> float:
    """Mean absolute error of the way over a window [m]."""
    missed = []
    for window, true in zip(windows, way, strict=True):
        travel = model.simulate(model.initial(p), window.u, window.dt, p)[1][:, 0]
        missed.append(abs(travel[-1] - travel[0] - true))
    return float(np.mean(missed))


def judged(robot: str, folder: Path) -> float:
    """Prints what the run finds; error of the live version."""
    even, odd = (steps(robot, folder, which) for which in (0, 1))
    way, name = ways(robot), f"drive_{robot}"
    with opened(name) as twin:
        result = twin.run([even])
        windows, base = twin.blocks([odd]), twin.setup.model
        before, live = (
            error(build(base, version.form), version.p, windows, way)
            for version in (twin.version(0), twin.champion)
        )
    for event in result.of_kind(*SAID):
        print(f"   row {event.row}: {event.kind}: {event.reason}")
    print(f"   as configured {before:.3f} m, live {live:.3f} m (asked {ASKED[robot]})")
    return live


def main() -> int:
    """Prints what was found; exit code 1 where it is more than asked."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    asked: dict[str, bool] = {}
    for robot, limit in ASKED.items():
        print(f"{robot}: the run over even steps, judged on odd ones")
        with tempfile.TemporaryDirectory() as folder:
            asked[f"{robot} at most {limit} m"] = judged(robot, Path(folder)) <= limit
    return ended(asked)


if __name__ == "__main__":
    sys.exit(main())
