"""What predictions are worth: `python -m benchmarks.strangers score FOLDER`.

Per machine and way to predict: the rms error per output over the test recordings, divided by that
of the true form from the same measured starts, mean over outputs. 1 is as good as knowing the
machine. *Closed*: the share of the way from the fitted textbook form to the true one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.strangers.draw import read

OWN, FITTED = "own", "scipy"


class Score(NamedTuple):
    """A machine's errors by way to predict, in units of the true form's."""

    machine: str
    ratio: dict[str, float]

    def closed(self, method: str) -> float:
        """Share of the gap between fitted textbook form and true form; below 0: worse."""
        return (self.ratio[FITTED] - self.ratio[method]) / max(self.ratio[FITTED] - 1.0, 1e-9)


def score(place: Path) -> Score:
    """The score of one machine: `PLACE/METHOD_K.csv` beside its `test_K.csv`."""
    about: Any = json.loads((place / "machine.json").read_text())
    tests = sorted(place.glob("test_*.csv"))
    methods = sorted({file.stem.rsplit("_", 1)[0] for file in place.glob("*_*.csv")})
    size: dict[str, np.ndarray] = {}
    for method in set(methods) - {"train", "test"}:
        off: list[np.ndarray] = []
        for test in tests:
            measured = read(test)
            file = place / f"{method}_{test.stem.rsplit('_', 1)[1]}.csv"
            predicted = read(file)
            gap = np.stack([measured[n] - predicted[n] for n in about["outputs"]], axis=1)
            for k, name in enumerate(about["outputs"]):
                if about["units"][name] == "rad" and about["form"] == "base":
                    gap[:, k] = (gap[:, k] + np.pi) % (2 * np.pi) - np.pi
            off.append(gap[1:])
        size[method] = np.sqrt(np.mean(np.concatenate(off) ** 2, axis=0))
    return Score(place.name, {m: float(np.mean(one / size[OWN])) for m, one in size.items()})
