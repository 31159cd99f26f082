"""A real arm followed in order of date: `python -m proofs.seasons [february] [autumn]`.

Needs EVERTWIN_DATA. `twins/ur10e.toml` with one store. It is commissioned by `evertwin fit --keep`
on the recordings of 5 and 6 February 2020; then those of 10, 12 and 19 February are run one by one,
in order of date, as separate runs, and after them those of autumn 2019, when the friction of three
joints was 30 to 50 % higher. Each second is predicted before anything is learned from it.

A figure is rms(measured − predicted) / rms(measured) of a joint in percent, both filtered as the
twin file says, over rows on which the joint is faster than 0.05 rad/s. In autumn the first 10 s of
a day and the first 3 s of a recording do not count. Beside it, over the same rows: the model as
commissioned, and friction and offsets of its law fitted to the day itself, which no prediction of
that law can be expected to beat.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from fnmatch import fnmatch
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.config.spec import StoreSpec
from evertwin.fold import Mark
from evertwin.models.spec import ParameterSpec
from planted.twins import opened, shipped
from proofs._verdict import ended, no_data
from proofs.ur10e import FRICTION, files

COMMISSIONED = ("20_02_05", "20_02_06")
LIMITS = {
    "february": np.full(6, 5.0), "autumn": np.array([5.0, 5.0, 5.0, 5.0, 6.0, 5.5]),
}  # fmt: skip
DAY, RECORDING = 10.0, 3.0
"""What does not count in autumn [s]."""


class Seen(NamedTuple):
    """One recording as it was run: rows, and which of them count, (n, 6)."""

    u: np.ndarray
    y: np.ndarray
    """Measured; NaN where it is not trusted."""
    predicted: np.ndarray
    counts: np.ndarray


def date(file: Path) -> str:
    """Year, month and day of a recording, from its name."""
    return file.stem[3:11]


def percent(twin: Twin, found: list[Seen]) -> np.ndarray:
    """Deviation of each joint over recordings together, (6,)."""
    smooth, sums = twin.setup.smooth_window, np.zeros((2, 6))
    assert smooth is not None
    for one in found:
        for k, part in enumerate((one.y - one.predicted, one.y)):
            sums[k] += np.nansum(np.where(one.counts, smooth(part), np.nan) ** 2, axis=0)
    known = np.where(sums[1] > 0.0, sums[1], np.nan)  # of some recordings no row counts
    return np.asarray(100 * np.sqrt(sums[0] / known))


def run(twin: Twin, file: Path, before: float) -> tuple[Seen, Counter[str], float]:
    """A recording beside the twin, what was said, and its length [s]; ``before``: seconds of its
    day so far (−1: all rows count)."""
    result = twin.run([file])
    trace = result.trace
    known = np.isin(trace["mark"], (Mark.OK, Mark.OVERRULED)) & np.isfinite(trace["residual"])
    t = (trace["t"] - trace["t"][0]) * 1e-9
    late = (t >= RECORDING) & (before + t >= DAY) if before >= 0.0 else t >= 0.0
    counts = known & late[:, None] & twin.setup.moving(trace["input"])
    y = np.where(known, trace["measured"], np.nan)
    seen = Seen(trace["input"], y, trace["predicted"], counts)
    return seen, Counter(event.kind for event in result.events), float(t[-1])


def refitted(known: Twin, recordings: list[Path]) -> np.ndarray:
    """The live version with friction and offsets fitted to these recordings, all parameters."""
    values = dict(zip(known.champion.names, known.champion.values, strict=True))
    own = tuple(n for n in values if values[n] and any(fnmatch(n, one) for one in FRICTION))
    model = {"parameters": {n: ParameterSpec(value=v) for n, v in values.items()}}
    with opened("ur10e", model=model, tuning={"editable": own, "ladder": ()}) as twin:
        return np.asarray(twin.fit(recordings).fit.p)


def season(name: str, twin: Twin, recordings: list[Path], first: np.ndarray) -> bool:
    """Prints a season, recording by recording; is it what was asked?"""
    said = Counter[str]()
    print(f"{name}: followed | as commissioned | fitted to the day; rows that count")
    sides: tuple[list[Seen], ...] = ([], [], [])
    for _, group in groupby(recordings, key=date):
        today, before = list(group), 0.0
        best = refitted(twin, today)
        for file in today:
            seen, events, seconds = run(twin, file, before if name == "autumn" else -1.0)
            before, said = before + seconds, said + events
            now = (seen, replaced(twin, seen, first), replaced(twin, seen, best))
            for side, one in zip(sides, now, strict=True):
                side.append(one)
            figures = " | ".join(shown(percent(twin, [one])) for one in now)
            rows = " ".join(f"{n:4d}" for n in seen.counts.sum(axis=0))
            print(f"   {file.stem:26} {figures}; {rows}", flush=True)
    told, *others = (percent(twin, side) for side in sides)
    print(f"   {'together':26} {' | '.join(map(shown, (told, *others)))}")
    print(f"   {'asked':26} {shown(LIMITS[name])}; said: {dict(said)}", flush=True)
    return bool((told <= LIMITS[name]).all())


def replaced(twin: Twin, seen: Seen, p: np.ndarray) -> Seen:
    """A recording as these parameters predict it."""
    y = twin.model.simulate(np.empty(0), seen.u, np.full(len(seen.u), 0.01), p)[1]
    return seen._replace(predicted=y)


def shown(values: np.ndarray) -> str:
    """Six figures."""
    return " ".join(f"{value:5.1f}" for value in values)


def main(names: list[str]) -> int:
    """Both seasons, or those asked for; autumn follows February all the same."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    known = files("identification")
    start = [file for file in known if date(file) in COMMISSIONED]
    seasons = {
        "february": [file for file in known if file not in start], "autumn": files("autumn")
    }  # fmt: skip
    reached = {}
    with tempfile.TemporaryDirectory() as folder:
        spec = replace(shipped("ur10e"), store=StoreSpec(path=f"{folder}/arm.db"))
        with Twin(spec) as twin:
            version = twin.keep(twin.fit(start))
            twin.promote(version.number, "commissioned")
        for name, recordings in seasons.items():
            with Twin(spec) as twin:
                reached[name] = season(name, twin, recordings, version.p)
            if [name] == names:
                break
    return ended(reached)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
