"""Whether the bands of a forecast hold on real machines: `python -m proofs.forecast_real`.

Needs EVERTWIN_DATA; with names of machines only those.

Many start points a machine. At each the twin knows the rows before it, learns its band from them,
and foretells the next rows under the inputs that were recorded. Counted is the share of measured
values inside; what follows ± is 1.96 standard errors over start points. Beside it a dummy: the last
value, and the spread of past moves over the same time. Angles wrap.

* incubator: parameters of one day of September 2020 (the twin file's); the box 10 and 30 min
  ahead on that day, on the day before, when the fan ran at half its voltage, and in March 2021.
  Apart, and not judged: half hours in which somebody opens the lid, which no twin can know.
* mrclam6: the twin runs over the first half of a robot's drive and improves itself; its pose 10 s
  ahead in the second half, the band from the 200 s before.
* emps: fitted to the first half of the record; position 1 s ahead, open loop, in the second.
* ur10e: fitted to two runs of 10 and 12 February; torques 2 s ahead in the run of 19 February.
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.fold import Block, Mark, take
from evertwin.signals import wrap
from planted.twins import opened, planned, with_values
from proofs._verdict import ended, holds, no_data

LEVELS, BELL = (0.8, 0.95), (1.2816, 1.96)
OPENED = "opened meanwhile"
LEADS = 20
"""Rows of a forecast that are counted, evenly over its horizon."""


class Shown(NamedTuple):
    """What one start point gave, by level: inside, half width, dummy inside, dummy half width."""

    said: str
    outputs: dict[str, tuple[str, np.ndarray]]


def recordings(*names: str) -> list[str]:
    """Files of EVERTWIN_DATA."""
    return [str(Path(os.environ["EVERTWIN_DATA"]).joinpath(name)) for name in names]


def fitted(name: str, train: Sequence[str]) -> Twin:
    """A twin file with the values that a fit has found."""
    with opened(name) as twin:
        return with_values(name, twin.fit(list(train)))


def starts(
    twin: Twin, rows: Block, span: tuple[float, ...], said: str, known: Sequence[Block] = ()
) -> Iterator[Shown]:  # fmt: skip
    """Start points over ``rows``: from ``span[0]`` on, every ``span[1]``, ``span[2]`` ahead [s].

    Known are other recordings, and the rows before; of ``span[3]`` seconds, if it is given.
    """
    (first, every, ahead), memory = span[:3], span[3] if len(span) > 3 else np.inf
    t = (rows.t - rows.t[0]) * 1e-9
    count = int((float(t[-1]) - ahead - first) // every) + 1
    for begin in first + np.arange(count) * every:
        i, j = (int(np.searchsorted(t, at)) for at in (begin, begin + ahead))
        u = rows.u[i:j]
        if rows.gap[i:j].any() or not np.isfinite(u).all():
            continue
        past, truth = take(rows, int(np.searchsorted(t, begin - memory)), i), rows.y[i:j]
        with tempfile.TemporaryDirectory() as folder:
            inputs = planned(twin.model, Path(folder) / "inputs.csv", u, rows.dt[i:j])
            found = twin.forecast(ahead, (*known, past), inputs=inputs)
        places = np.unique(np.linspace(0, j - i - 1, LEADS).astype(int))
        measured = rows.mark[i:j, u.shape[1] :] == Mark.OK
        outputs = {}
        for k, channel in enumerate(twin.model.outputs):
            here = places[measured[places, k] & np.isfinite(truth[places, k])]
            if len(here) and np.isfinite(past.y[:, k]).any():
                angle = bool(twin.model.outputs.angles[k])
                one = counted(found.outputs[channel.name], truth[:, k], past.y[:, k], here, angle)
                outputs[channel.name] = (channel.unit, one)
        yield Shown(said, outputs)


def counted(out, truth, past, places, angle) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Inside, half width, dummy inside, dummy half width by level, (2, 4)."""

    def apart(a: np.ndarray) -> np.ndarray:
        return np.asarray(wrap(a[:, None], np.array([angle]))[:, 0])

    last = past[np.isfinite(past)][-1]
    off, still = np.abs(apart(truth - out.value)[places]), np.abs(apart(truth - last)[places])
    lags = [min(k + 1, len(past) // 2) for k in places.tolist()]
    moves = [np.sqrt(np.nanmean(apart(past[lag:] - past[:-lag]) ** 2)) for lag in lags]
    size = np.array(moves)
    rows = []
    for level, factor in zip(LEVELS, BELL, strict=True):
        low, high = out.band(level)
        half = ((high - low) / 2)[places]
        rows.append(
            (np.mean(off <= half), half.mean(), np.mean(still <= factor * size),
             factor * size.mean())
        )  # fmt: skip
    return np.array(rows)


def incubator() -> Iterator[Shown]:
    """The box, 10 and 30 minutes ahead."""
    march = "incubator/20210321_lid_opening_7pmodel/"
    learnt, *weaker, lid, events = recordings(
        "incubator/20200918_calibration_fan_24V/semi_random_movement.csv",
        "incubator/20200917_calibration_fan_12v/ramp_up_cool_down.csv",
        "incubator/20200917_calibration_fan_12v/random_on_off_sequences_1.csv",
        march + "lid_opening_experiment_mar_2021.csv", march + "events.csv",
    )  # fmt: skip
    twin = opened("incubator_lid")
    for minutes in (10, 30):
        for record in (learnt, *weaker):
            day = "the same day" if record == learnt else "fan at half its voltage"
            span = (1500.0, 150.0, 60.0 * minutes)
            yield from starts(twin, twin.blocks([record])[0], span, f"{day}, {minutes} min ahead")
    rows = twin.blocks([lid])[0]
    with Path(events).open(encoding="utf-8") as file:
        opens = [int(r["time"]) for r in csv.DictReader(file) if r["code"] == "lid_open"]
    for begin in np.arange(1500.0, float(rows.t[-1] - rows.t[0]) * 1e-9 - 1800.0, 300.0):
        now = int(rows.t[0]) + int(begin * 1e9)
        soon = any(now < at < now + 1800 * 10**9 for at in opens)
        said = f"2021, lid {OPENED if soon else 'closed'}, 30 min ahead"
        yield from starts(twin, rows, (begin, 1e9, 1800.0), said)


def mrclam6() -> Iterator[Shown]:
    """Two robots, 10 s ahead."""
    for robot in (1, 2):
        files = recordings(*(f"mrclam6/Robot{robot}_{kind}.dat.gz"
                             for kind in ("Odometry", "Groundtruth")))  # fmt: skip
        with opened("mrclam6") as twin:
            rows = twin.blocks(files)[0]
            middle = len(rows.t) // 2
            twin.run((take(rows, 0, middle),))
            begin = float(rows.t[middle] - rows.t[0]) * 1e-9
            yield from starts(twin, rows, (begin, 10.0, 10.0, 200.0), "10 s ahead")


def emps() -> Iterator[Shown]:
    """The axis, 1 s ahead."""
    (record,) = recordings("emps/DATA_EMPS.mat")
    with fitted("emps_free", [f"{record}@:12.42"]) as twin:
        rows = twin.blocks([record])[0]
        yield from starts(twin, rows, (12.42, 0.5, 1.0), "1 s ahead")


def ur10e() -> Iterator[Shown]:
    """The arm's torques, 2 s ahead."""
    *train, test = recordings(*(f"ur10e/identification/ur-20_02_{name}.csv" for name in (
        "10-30sec_12harm", "12-50sec_12harm", "19_14harm50sec")))  # fmt: skip
    with fitted("ur10e", train) as twin:
        known, rows = twin.blocks(train), twin.blocks([test])[0]
        yield from starts(twin, rows, (3.0, 2.0, 2.0), "2 s ahead", known)


def told(machine: str, shown: Sequence[Shown]) -> dict[str, bool]:
    """Prints a machine's shares; does each band hold what it says?"""
    demands = {}
    for said in dict.fromkeys(one.said for one in shown):
        group = [one.outputs for one in shown if one.said == said]
        for name in dict.fromkeys(name for outputs in group for name in outputs):
            unit = next(outputs[name][0] for outputs in group if name in outputs)
            found = np.array([outputs[name][1] for outputs in group if name in outputs])
            mean = found.mean(axis=0)
            error = 1.96 * found[:, :, 0].std(axis=0) / np.sqrt(len(found))
            sys.stdout.write(f"   {said}, {name}, {len(found)} starts:")
            for k, level in enumerate(LEVELS):
                good = holds(level, mean[k, 0], error[k])
                if OPENED not in said:
                    demands[f"{machine}, {said}, {name}, {level:.0%}"] = good
                off = "" if good else " <- too wide" if mean[k, 0] > level else " <- too narrow"
                sys.stdout.write(
                    f"  {level:.0%} band {100 * mean[k, 0]:.1f} ± {100 * error[k]:.1f} %{off}, "
                    f"± {mean[k, 1]:.3g} {unit} (dummy {100 * mean[k, 2]:.1f} %, "
                    f"± {mean[k, 3]:.3g})"
                )
            sys.stdout.write("\n")
    return demands


MACHINES: dict[str, Callable[[], Iterator[Shown]]] = {
    "incubator": incubator, "mrclam6": mrclam6, "emps": emps, "ur10e": ur10e,
}  # fmt: skip


def main(names: list[str]) -> int:
    """Prints each machine; exit code 1 where a band holds less or more than it says."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    demands: dict[str, bool] = {}
    for name in names or MACHINES:
        sys.stdout.write(f"{name}\n")
        demands |= told(name, list(MACHINES[name]()))
        sys.stdout.flush()
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
