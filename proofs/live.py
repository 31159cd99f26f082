"""Every shipped twin file runs live: `python -m proofs.live [SEED] [TWIN ...]`.

For each file in `twins/` a recording of its machine (of an embedded world, planted, or the real one
that the file names: those need EVERTWIN_DATA) is run with `Twin.run`, and its samples are pushed to
a second twin with `Twin.push`, one by one and in random pieces of up to a quarter of a beat. Slow
work runs in this process, so an answer comes at the row at which it is due. Every column of every
row (time, task, inputs, what was measured and predicted, band, marks, version) and every entry of
the log (requests, answers, versions, decisions) has to be the same in each bit; and whatever the
log says has to stand there before one beat and the declared delay have come after its row.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from evertwin.rows import Data
from planted import joints
from planted.pushed import compared, tank
from planted.robots import drive
from planted.twins import TWINS, opened, shipped
from planted.worlds import record_arm, record_live, record_robot
from proofs import elsewhere
from proofs._verdict import ended, no_data
from proofs.cascaded import split

Recording = Callable[[Path], Data]


def _arm(folder: Path) -> Data:
    record_arm(folder / "arm", "--cycles", "3", "--seed", "1")
    return sorted((folder / "arm").glob("*.csv"))


def _robot(*options: str) -> Recording:
    def recorded(folder: Path) -> Data:
        record_robot(folder / "robot.csv", *options)
        return folder / "robot.csv"

    return recorded


def _joint(folder: Path) -> Data:
    t, u = joints.motion(60.0)
    with joints.joint({"gearbox.Fc": 12.0}) as twin:
        return joints.measured(twin, t, u, np.random.default_rng(1).normal(0.0, 0.5, len(t)))


def _mass(folder: Path) -> Data:
    return elsewhere.recorded(opened("mass"), seed=1)[0]


def _tank(folder: Path) -> Data:
    return tank(6000)


def _line(folder: Path) -> Data:
    return drive(1).columns


def _real(*parts: str) -> Recording:
    """Recordings below EVERTWIN_DATA; without parts those that the file names."""
    there = Path(os.environ.get("EVERTWIN_DATA", ""))
    return lambda _: [there / part for part in parts] or None


def _said(name: str, seconds: float, *orders: str, topics: str = "command,scan") -> Recording:
    """What a living machine says."""
    return lambda folder: record_live(name, folder / f"{name}.csv", seconds, *orders, topics=topics)


EMPS = _real("emps/DATA_EMPS.mat")
CASES: dict[str, Recording] = {
    "arm_live": _said("arm", 300.0, "150:friction.2=1.3"), "robot_live": _said("robot", 600.0),
    "robot_pose": _said("robot", 600.0, topics="command,pose"),
    "arm": _arm, "robot": _robot("--seconds", "600", "--seed", "1"),
    "robot1d": _robot("--light", "--world", "w3", "--seconds", "600", "--seed", "1"),
    "joint": _joint, "mass": _mass, "template": _tank, "wear": _line,
    "drive_husky": _real(), "drive_warthog": _real(), "incubator": _real(),
    "incubator_lid": _real(), "tanks": lambda folder: split(folder)[:1],
    "mrclam6": _real("mrclam6/Robot1_Odometry.dat.gz@0:400",
                     "mrclam6/Robot1_Groundtruth.dat.gz@0:400"),
    "robotino": _real(*(f"robotino/table/exp{i:02}.csv" for i in range(0, 72, 3))),
    "ur10e": _real("ur10e/identification/ur-20_02_05-20sec_8harm.csv",
                   "ur10e/identification/ur-20_02_05-20sec_12harm.csv"),
    **dict.fromkeys(("emps", "emps_axis", "emps_axis_free", "emps_free", "emps_linear"), EMPS),
}  # fmt: skip


def main() -> int:
    """A line for each twin file."""
    seed, names = (int(sys.argv[1]) if len(sys.argv) > 1 else 1), sys.argv[2:]
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    others = sorted({path.stem for path in TWINS.glob("*.toml")} - set(CASES))
    print(f"not asked: {', '.join(others)}")
    alike, soon = [], []
    for name in names or sorted(CASES):
        begun = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            found = compared(shipped(name), CASES[name](Path(folder)), np.random.default_rng(seed))
        alike.append(not found.different)
        soon.append(found.late <= found.beat + found.delay)
        print(
            f"{name:15} {found.result.samples:6d} rows, {found.pieces:6d} pieces, "
            f"{found.entries:4d} entries, known {found.late:4d} rows late: "
            f"beat {found.beat} + delay {found.delay}",
            f"({time.process_time() - begun:.0f} s)",
            *(f"\n  {one[:400]}" for one in found.different),
            flush=True,
        )
    print(f"alike {sum(alike)} of {len(alike)}, in time {sum(soon)}")
    return ended({"pushed = recorded": all(alike), "within beat + delay": all(soon)})


if __name__ == "__main__":
    sys.exit(main())
