"""The textbook forms in NumPy: as given, and fitted by SciPy's least squares on every window."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy

from benchmarks.strangers.draw import Columns, read, save, windows

Numbers = dict[str, float]


def predict(about: dict[str, object], numbers: Numbers, rows: Columns, horizon: float) -> Columns:
    """Predictions of one recording, each from the measurement at the start of its horizon."""
    roles: dict[str, str] = about["roles"]  # type: ignore[assignment]
    seen = {role: rows[name] for role, name in roles.items()}
    if about["form"] == "drive":
        mass, fv, fc, offset = (numbers[name] for name in ("M", "Fv", "Fc", "offset"))
        force = mass * seen["acc"] + fv * seen["vel"] + fc * np.sign(seen["vel"]) + offset
        return {roles["force"]: force}
    step = {"cart": _cart, "base": _base, "tank": _tank}[str(about["form"])]
    found = {role: seen[role].copy() for role in ("x", "y", "heading") if role in seen}
    for a, b in windows(rows["t"], horizon):
        part = {role: values[a : b + 1] for role, values in seen.items()}
        for role, values in step(rows["t"][a : b + 1], part, numbers).items():
            found[role][a + 1 : b + 1] = values[1:]
    return {roles[role]: values for role, values in found.items()}


def _summed(start: float, speed: np.ndarray, dt: np.ndarray) -> np.ndarray:
    return np.r_[start, start + np.cumsum(speed[:-1] * dt)]


def _cart(t: np.ndarray, seen: Columns, numbers: Numbers) -> Columns:
    return {"x": _summed(seen["x"][0], numbers["gain"] * seen["v"], np.diff(t))}


def _base(t: np.ndarray, seen: Columns, numbers: Numbers) -> Columns:
    dt, v, w = np.diff(t), numbers["gv"] * seen["v"], numbers["gw"] * seen["w"]
    heading = _summed(seen["heading"][0], w, dt)
    middle = heading + np.r_[0.5 * w[:-1] * dt, 0.0]
    x = _summed(seen["x"][0], v * np.cos(middle), dt)
    y = _summed(seen["y"][0], v * np.sin(middle), dt)
    return {"x": x, "y": y, "heading": heading}


def _tank(t: np.ndarray, seen: Columns, numbers: Numbers) -> Columns:
    stay = float(np.exp(-(t[1] - t[0]) / max(numbers["tau"], 1e-9)))
    goal = (1.0 - stay) * (numbers["k"] * seen["u"] + numbers["offset"])
    x, _ = scipy.signal.lfilter([1.0], [1.0, -stay], goal[:-1], zi=[stay * seen["x"][0]])
    return {"x": np.r_[seen["x"][0], x]}


def fitted(about: dict[str, object], train: Sequence[Columns], horizon: float) -> Numbers:
    """The numbers with the least squares of what the windows are off by, in noise units."""
    start: Numbers = about["parameters"]  # type: ignore[assignment]
    noise: Numbers = about["noise"]  # type: ignore[assignment]
    size = np.array([value if value else 1.0 for value in start.values()])

    def numbers(x: np.ndarray) -> Numbers:
        return dict(zip(start, (x * size).tolist(), strict=True))

    def residual(x: np.ndarray) -> np.ndarray:
        found = []
        for rows in train:
            for name, values in predict(about, numbers(x), rows, horizon).items():
                found.append((values - rows[name]) / noise[name])
        return np.concatenate(found)

    first = np.array(list(start.values())) / size
    return numbers(scipy.optimize.least_squares(residual, first).x)


def write(place: Path) -> None:
    """Writes `naive_K.csv`, the textbook form as given, and `scipy_K.csv`, fitted."""
    about = json.loads((place / "machine.json").read_text())
    train = [read(file) for file in sorted(place.glob("train_*.csv"))]
    methods = {
        "naive": about["parameters"], "scipy": fitted(about, train, about["horizon"])
    }  # fmt: skip
    for file in sorted(place.glob("test_*.csv")):
        for method, numbers in methods.items():
            found = predict(about, numbers, read(file), about["horizon"])
            save(place / f"{method}_{file.stem.rsplit('_', 1)[1]}.csv", found)
