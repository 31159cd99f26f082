"""P1's own robot, real: `python -m proofs.robotino [KIND ...]` (needs EVERTWIN_DATA).

A Festo Robotino (Belyaev et al., 2021) on a gray floor (216 runs) and on a table (72), with
`twins/robotino.toml`. Even files train, odd test. Terms and gains are those that `Twin.fit` finds;
the rows are those of `Twin.export`, predicted over whole runs from the set speeds alone (without
measured motor speeds, ``odometry = false``).

1. For each floor, as configured, and with each KIND of term (law and table): error of run means
   from 30 % of the run on, of motor speed (each wheel) and of body speed (way a second in the
   base's own frame); the rms of the single rows beside it; what was found, with intervals; position
   updates on the odd files by `Twin.run`.
2. The even files of a floor in reverse order: are form and numbers the same?
3. Table, gray floor, table in one run, and gray floor, table, gray floor: when a change is told,
   named, and a version live that was learned behind it.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from evertwin import FitResult
from evertwin.fold import Event
from planted.twins import opened
from proofs._verdict import ended, no_data

SETTLED = 0.3
"""Share of a run after which it counts."""
MOTORS = ("motor1", "motor2", "motor3")
SIZES = {"wheels": True, "wheel_radius": 0.04, "wheel_distance": 0.125, "gear": 16.0}
CHAIN = {"options": SIZES}
"""The same machine, its pose from the set speeds alone: what the motors make of them moves it."""
ASKED = {
    ("gray", "law", "motor"): 1.43, ("table", "law", "motor"): 0.85,
    ("gray", "law", "body"): 0.0070, ("table", "law", "body"): 0.0014,
    ("gray", "table", "motor"): 1.2 * 1.43, ("table", "table", "motor"): 1.2 * 0.85,
}  # fmt: skip
TOLD, ROW = 10.0, 1.0 / 32.0
"""Time in which a change of floor has to be told, and from row to row [s]."""
SAME = 0.01
"""Relative difference below which two numbers are the same: their intervals are wider."""
NAMES = ("normal", "abnormal")
WHAT = {"told": ("suspected", *NAMES), "named": NAMES, "live": ("promoted", "rolled_back")}
"""Kinds of event that tell a change, that name it, that end it."""
FOUND = ("suspected", "abnormal", "normal", "corrected", "tuned", "promoted", "rolled_back")


class Off(NamedTuple):
    """Errors on the runs of a floor, rad/s and m/s."""

    motor: float
    body: float
    motor_row: float
    body_row: float


def runs(floor: str) -> list[Path]:
    """The recordings of a floor, in order."""
    return sorted((Path(os.environ["EVERTWIN_DATA"]) / "robotino" / floor).glob("*.csv"))


def speed(pose: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Speed in the base's own frame between rows, (n − 1, 2)."""
    way, middle = np.diff(pose[:, :2], axis=0), pose[:-1, 2] + 0.5 * _turned(pose[:, 2])
    c, s = np.cos(middle), np.sin(middle)
    own = np.stack([c * way[:, 0] + s * way[:, 1], c * way[:, 1] - s * way[:, 0]], axis=1)
    return np.asarray(own / np.diff(t)[:, None])


def _turned(heading: np.ndarray) -> np.ndarray:
    return np.asarray((np.diff(heading) + np.pi) % (2.0 * np.pi) - np.pi)


def judged(rows: dict[str, np.ndarray]) -> Off:
    """Measured against predicted."""
    task, t = rows["task"].ravel(), rows["t"].ravel()

    def columns(names: Sequence[str], kind: str, own: np.ndarray) -> np.ndarray:
        return np.stack([rows[name + kind].ravel()[own] for name in names], axis=1)

    found = []
    for number in np.unique(task):
        own = np.flatnonzero(task == number)
        own = own[int(SETTLED * len(own)) :]
        pose = [speed(columns(("x", "y", "heading"), k, own), t[own]) for k in ("", "_predicted")]
        means = [float(np.hypot(*one.mean(axis=0))) for one in pose]
        motor = columns(MOTORS, "", own) - columns(MOTORS, "_predicted", own)
        found.append((
            np.abs(motor.mean(axis=0)).mean(), abs(means[0] - means[1]), np.mean(motor**2),
            np.mean((pose[0] - pose[1]) ** 2),
        ))  # fmt: skip
    motors, bodies, motor_rows, body_rows = np.mean(found, axis=0).tolist()
    return Off(motors, bodies, motor_rows**0.5, body_rows**0.5)


def scored(floor: str, form: str, result: FitResult | None) -> tuple[Off, int]:
    """Errors and position updates on the odd files."""
    still = {"editable": ()}, {"terms": ()}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rows.mat"
        with opened("robotino", model=CHAIN, prediction={"horizon": float("inf")}) as twin:
            number = 0 if result is None else twin.keep(result).number
            twin.export(file, "mat", number, runs(floor)[1::2])
        off = judged(scipy.io.loadmat(file))
    with opened("robotino", model=CHAIN, tuning=still[0], correction=still[1]) as twin:
        if result is not None:
            twin.promote(twin.keep(result).number)
        updates = twin.run(runs(floor)[1::2]).position_updates[1]
    print(
        f"   {form:14} motor {off.motor:6.2f} rad/s, body {off.body:.4f} m/s; row by row "
        f"{off.motor_row:.2f} rad/s, {off.body_row:.4f} m/s; {updates} position updates",
        flush=True,
    )
    return off, updates


def fitted(floor: str, kind: str, order: int = 1) -> FitResult:
    """The fit to the even files, in their order or (−1) in the reverse of it."""
    with opened("robotino", correction={"terms": (kind,)}) as twin:
        return twin.fit(runs(floor)[::2][::order])


def ordered(floor: str, kind: str, result: FitResult) -> dict[str, bool]:
    """Does the reverse order of the files give the same?"""
    other = fitted(floor, kind, -1)
    one, two = (dict(zip(r.fit.names, r.fit.values, strict=True)) for r in (result, other))
    off = max(abs(two[n] / one[n] - 1.0) for n in one) if set(one) == set(two) else np.inf
    print(f"2. {floor}, {kind}, files in reverse order: numbers differ by {100 * off:.2g} %")
    return {f"{floor}: the order of files changes nothing": off <= SAME}


def told(result: FitResult) -> None:
    """What was found, with intervals."""
    fit = result.fit
    for name, value, (low, high), verdict in zip(
        fit.names, fit.values, fit.interval95, fit.verdict, strict=True
    ):
        if not name.startswith("table"):
            print(f"      {name:20} {value:8.4g} [{low:.4g}, {high:.4g}] {verdict}")


def _named(event: Event) -> bool:
    """Is it the floor that is named, or that it is one which was there before?"""
    return event.signal == "floor" or "version" in event.evidence


def changed(floors: tuple[str, str, str]) -> dict[str, bool]:
    """One run over three floors: is each change told in time?"""
    chosen = (slice(0, 72, 3), slice(0, 72, 6), slice(1, 72, 6))
    parts = [runs(floor)[some] for floor, some in zip(floors, chosen, strict=True)]
    with opened("robotino") as twin:
        rows = np.cumsum([sum(len(b.t) for b in twin.blocks(part)) for part in parts]).tolist()
        result = twin.run([file for part in parts for file in part])
    for event in result.of_kind(*FOUND):
        print(f"   row {event.row}: {event.kind} {event.signal}: {event.reason}")
    demands = {}
    for row, floor, end in zip(rows, floors[1:], rows[1:], strict=False):
        late = {}
        for what, kinds in WHAT.items():
            after = [
                e.row for e in result.of_kind(*kinds)
                if row < e.row <= end and (e.kind not in NAMES or _named(e))
            ]  # fmt: skip
            late[what] = (after[0] - row) * ROW if after else float("inf")
        said = ", ".join(f"{what} after {seconds:.0f} s" for what, seconds in late.items())
        print(f"   {floor} from row {row} on: {said} of driving")
        demands[f"change to {floor}: {said} (asked {TOLD:g})"] = late["told"] <= TOLD
    return demands


def main(kinds: list[str]) -> int:
    """Prints all parts; 1 if a figure is missed."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    demands: dict[str, bool] = {}
    for floor in ("gray", "table"):
        print(f"1. {floor}: {len(runs(floor)[1::2])} runs")
        scored(floor, "as configured", None)
        off = {}
        for kind in kinds:
            result = fitted(floor, kind)
            off[kind], _ = scored(floor, kind, result)
            told(result)
            demands |= ordered(floor, kind, result) if floor == "table" and kind == "law" else {}
        for (where, kind, what), limit in ASKED.items():
            if where == floor and kind in off:
                found = getattr(off[kind], what)
                said = f"{what} speed, {floor}, by {kind}: {found:.4g} (asked {limit:.4g})"
                demands[said] = found <= limit
    for floors in (("table", "gray", "table"), ("gray", "table", "gray")):
        print(f"3. {', '.join(floors)} in one run")
        demands |= changed(floors)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["law", "table"]))
