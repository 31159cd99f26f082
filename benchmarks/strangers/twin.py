"""What evertwin makes of a stranger: its twin file from one template per textbook form, one run
over the recordings to learn from, and the live version's predictions of the others.

All lengths of time are multiples of the machine's horizon; the requirement is twice the noise.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import scipy

from benchmarks.strangers.draw import read, save
from evertwin import RunResult, Twin

TWINS = Path(__file__).parent / "twins"
SIZES = {"mm": 1e-3, "cm": 1e-2}
BEAT, WINDOW, LONG = 1.0, 5.0, 400.0
"""Horizons from decision to decision, that a deviation is judged on, that are learned from."""


def twin_file(place: Path) -> Path:
    """The machine's twin file, written beside its recordings."""
    about: Any = json.loads((place / "machine.json").read_text())
    roles, units, horizon = about["roles"], about["units"], about["horizon"]
    noise = about["noise"][about["outputs"][0]]
    names = roles | {f"{role}_unit": units[name] for role, name in roles.items()}
    spans = {"horizon": horizon, "beat": BEAT * horizon, "window": WINDOW * horizon}
    text = Template((TWINS / f"{about['form']}.toml").read_text()).substitute(
        names | about["parameters"] | spans, long=LONG * horizon, requirement=2.0 * noise
    )
    shutil.copy(TWINS / "tank.py", place)
    file = place / "twin.toml"
    file.write_text(text)
    return file


def run(place: Path) -> RunResult:
    """Runs the twin, and fits it; writes `configured_K.csv`, `run_K.csv`, `fit_K.csv`."""
    about: Any = json.loads((place / "machine.json").read_text())
    train, test = (sorted(place.glob(f"{part}_*.csv")) for part in ("train", "test"))
    learned = [str(file) for file in train]
    with Twin.open(twin_file(place)) as twin:
        result = twin.run(learned)
        numbers = {"configured": 0, "run": twin.champion.number}
        _predicted(place, twin, numbers, test, about)
    with Twin.open(place / "twin.toml") as twin:  # a fit begins with what the run began with
        _predicted(place, twin, {"fit": twin.keep(twin.fit(learned)).number}, test, about)
    return result


def _predicted(
    place: Path, twin: Twin, numbers: dict[str, int], test: list[Path], about: Any
) -> None:
    """What versions of a twin predict, by method."""
    for method, number in numbers.items():
        rows = place / "rows.mat"
        twin.export(rows, "mat", number, [str(file) for file in test])
        _saved(place, method, test, scipy.io.loadmat(rows), about)


def _saved(place: Path, method: str, test: list[Path], rows: Any, about: Any) -> None:
    """The predictions of each recording in its own units."""
    roles = {name: role for role, name in about["roles"].items()}
    start = 0
    for file in test:
        n = len(read(file)["t"])
        part = slice(start, start + n)
        start += n
        found = {
            name: rows[roles[name] + "_predicted"].ravel()[part]
            / (SIZES.get(about["units"][name], 1.0) if about["form"] != "tank" else 1.0)
            for name in about["outputs"]
        }
        save(place / f"{method}_{file.stem.rsplit('_', 1)[1]}.csv", found)
    assert start == len(np.ravel(rows["t"])), "each row of the recordings has to be there"
