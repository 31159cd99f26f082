"""Machines that nothing happens to: `python -m proofs.calm [HOURS [FAMILY ...]]`.

Shipped twin files beside machines as they describe them, for 2,000 hours each, a day a recording,
one twin. No machine is still: a drive's gain follows the hall's temperature by 1 % over the day and
slips by 1 % for half a minute at a time; an arm's dry friction follows it by 3 %, and its cycles
are those of the embedded arm, drawn anew. Noise is the sensors'. All of it is far within what the
twin files ask. Counted is whatever says that something is wrong, once the twin was fitted to its
first day: asked is at most twice the one false alarm a month that the files declare, and that
nothing goes live.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import scipy

from evertwin import Twin
from planted.twins import opened, with_values
from planted.worlds import record_arm
from proofs._verdict import ended
from proofs.follow import FRICTION, WIDTH

Columns = dict[str, np.ndarray]
Day = Callable[[int], Columns]
ALARMS = (
    "suspected", "drift", "abnormal", "external", "recurring", "measurement_error", "unexpected",
    "state", "changed",
)  # fmt: skip
SECONDS = 86_400
CYCLE = 690


def slip(rng: np.random.Generator, rows: int) -> np.ndarray:
    """What of a gain comes and goes within half a minute, at 1 Hz."""
    keeps = np.exp(-1.0 / 30.0)
    fresh = 0.01 * np.sqrt(1.0 - keeps**2) * rng.standard_normal(rows)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -keeps], fresh))


def hall(day: int, rows: int) -> np.ndarray:
    """−1 at night, 1 at noon, somewhat more on some days than on others."""
    size = np.random.default_rng([9, day]).uniform(0.5, 1.0)
    return np.asarray(-size * np.cos(2.0 * np.pi * np.arange(rows) / rows))


def commands(rng: np.random.Generator, top: int) -> np.ndarray:
    """Steps of 1 cm/s up to ``top``, each held for 3 to 8 s."""
    held = rng.integers(3, 9, SECONDS)
    return np.repeat(0.01 * rng.integers(0, top + 1, SECONDS), held)[:SECONDS]


def drive(day: int) -> Columns:
    """One axis of a base, its position known to 2 mm."""
    rng = np.random.default_rng([1, day])
    v = commands(rng, 20)
    speed = v * (1.0 + 0.01 * hall(day, SECONDS) + slip(rng, SECONDS))
    x = np.r_[0.0, np.cumsum(speed[:-1])]
    return {"t": _clock(day), "v": v, "x": x + rng.normal(0.0, 0.002, SECONDS)}


def base(day: int) -> Columns:
    """A base on a floor, its pose known to 2 mm and 2 mrad."""
    rng = np.random.default_rng([2, day])
    v, w = commands(rng, 20), rng.permutation(commands(rng, 20)) - 0.1
    gain = 1.0 + 0.01 * hall(day, SECONDS) + slip(rng, SECONDS)
    heading = np.r_[0.0, np.cumsum(w[:-1])]
    ends = np.r_[heading[1:], heading[-1] + w[-1]]
    turn = np.where(np.abs(w) > 1e-9, w, 1.0)
    straight = np.abs(w) <= 1e-9
    along = np.where(straight, np.cos(heading), (np.sin(ends) - np.sin(heading)) / turn)
    across = np.where(straight, np.sin(heading), (np.cos(heading) - np.cos(ends)) / turn)
    x, y = (np.r_[0.0, np.cumsum((v * gain * part)[:-1])] for part in (along, across))
    seen = {"x": x, "y": y}
    noisy = {name: one + rng.normal(0.0, 0.002, SECONDS) for name, one in seen.items()}
    wrapped = np.angle(np.exp(1j * (heading + rng.normal(0.0, 0.002, SECONDS))))
    return {"t": _clock(day), "v": v, "w": w, **noisy, "heading": wrapped}


def _clock(day: int) -> np.ndarray:
    return np.arange(SECONDS) + float(SECONDS) * day


def arm(folder: Path) -> Day:
    """Days of cycles that the embedded arm's process recorded."""
    record_arm(folder, "--cycles", "40", "--seed", "5")
    tables = [np.genfromtxt(f, delimiter=",", names=True) for f in folder.glob("cycle-*.csv")]
    names = {name.split(" ")[0].split("_")[0]: name for name in tables[0].dtype.names or ()}
    cycles = {short: np.array([one[name] for one in tables]) for short, name in names.items()}

    def day(number: int) -> Columns:
        rng = np.random.default_rng([3, number])
        drawn = rng.integers(0, len(tables), SECONDS * 10 // CYCLE)
        columns = {short: values[drawn].ravel() for short, values in cycles.items()}
        rows = len(columns["t"])
        warm = 0.03 * hall(number, rows)
        for k in range(6):
            friction = FRICTION[k] * np.tanh(columns[f"qd{k + 1}"] / WIDTH)
            columns[f"tau{k + 1}"] = columns[f"tau{k + 1}"] - warm * friction
        columns["t"] = np.arange(rows) * 0.1 + float(SECONDS) * number
        return columns

    return day


@contextmanager
def family(name: str) -> Iterator[tuple[Twin, Day]]:
    """A twin that knows its machine, and the machine's days."""
    if name != "arm":
        with opened({"drive": "robot1d", "base": "robot"}[name]) as twin:
            yield twin, {"drive": drive, "base": base}[name]
        return
    with tempfile.TemporaryDirectory() as folder:
        day = arm(Path(folder) / "arm")
        first = day(0)
        cycles = np.arange(len(first["t"])) // CYCLE % 60 == 0
        with opened("arm") as twin:
            known = twin.fit({one: column[cycles] for one, column in first.items()})
        with with_values("arm", known) as twin:
            yield twin, day


def main(hours: float, names: list[str]) -> int:
    """Prints a line per family."""
    demands = {}
    days = int(np.ceil(hours / 24.0))
    for name in names:
        with family(name) as (twin, day):
            found = Counter[str]()
            for number in range(days):
                result = twin.run(day(number))
                for event in result.events:
                    if event.kind in (*ALARMS, "promoted") and event.row < result.samples:
                        found[event.kind] += 1
                        if event.kind in ALARMS and found[event.kind] <= 3:
                            print(f"   day {number} row {event.row} {event.kind}: {event.reason}",
                                  flush=True)  # fmt: skip
        alarms = sum(found[kind] for kind in ALARMS)
        allowed = 2.0 * days / 30.0
        print(f"{name}: {alarms} alarms in {24 * days} h (at most {allowed:.1f}), promoted "
              f"{found['promoted']}; {dict(found)}", flush=True)  # fmt: skip
        demands[f"{name}: false alarms"] = alarms <= allowed
        demands[f"{name}: nothing goes live"] = found["promoted"] == 0
    return ended(demands)


if __name__ == "__main__":
    sys.exit(
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 2000.0,
             sys.argv[2:] or ["drive", "base", "arm"])
    )  # fmt: skip
