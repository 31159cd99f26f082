"""Stamps in another unit of time than they are read in are told, and nothing is learned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from planted.draws import first_of

FILE = """schema = 1
name = "base"
[model]
kind = "differential"
[[source]]
name = "log"
time = {{ column = "t", unit = "{unit}" }}
[source.channels]
v = {{ column = "v", unit = "m/s" }}
w = {{ column = "w", unit = "rad/s" }}
x = {{ column = "x", unit = "m" }}
y = {{ column = "y", unit = "m" }}
heading = {{ column = "heading", unit = "rad" }}
[anomaly]
requirement = "1 cm"
"""


def written(folder: Path, seed: int, times: float) -> Path:
    """A base at 10 Hz, its stamps in a unit of which ``times`` are a second."""
    rng, n, dt = np.random.default_rng(seed), 3000, 0.1
    v, w = (np.repeat(rng.uniform(a, b, n // 30), 30) for a, b in ((-0.2, 0.6), (-0.8, 0.8)))
    heading = np.concatenate([[0.0], np.cumsum(w * dt)[:-1]])
    x, y = (np.concatenate([[0.0], np.cumsum(0.95 * v * f(heading + 0.5 * w * dt) * dt)[:-1]])
            for f in (np.cos, np.sin))  # fmt: skip
    heading = (heading + np.pi) % (2 * np.pi) - np.pi
    rows = np.column_stack([np.rint(times * dt * np.arange(n)), v, w, x, y, heading])
    rows[:, 3:] += rng.normal(0.0, 0.002, (n, 3))
    file = folder / "log.csv"
    np.savetxt(file, rows, delimiter=",", header="t,v,w,x,y,heading", comments="", fmt="%.10g")
    return file


def twin(folder: Path, unit: str) -> Twin:
    file = folder / "base.toml"
    file.write_text(FILE.format(unit=unit))
    return Twin.open(file)


@first_of(("seed", "times", "unit"), [(1, 1e3, "s"), (2, 1e6, "ms"), (3, 1e3, "us")])
def test_stamps_in_another_unit_are_told_of_all(
    tmp_path: Path, seed: int, times: float, unit: str
) -> None:
    file = written(tmp_path, seed, times)
    true = {1e3: "ms", 1e6: "us"}[times]
    with twin(tmp_path, unit) as base:
        result = base.run(file)
        found = [one for one in base.doctor(file).findings if one.kind == "unit"]
    assert f"he stamps look like {true} read as {unit}" in result.headline
    assert "nothing is learned" in result.headline and not result.of_kind("promoted")
    assert f"{true} read as {unit}" in found[0].reason and "[[source]] time" in found[0].where


@pytest.mark.parametrize(("times", "unit"), [(1e3, "ms"), (1e6, "us")])
def test_stamps_in_their_unit_are_not_doubted(tmp_path: Path, times: float, unit: str) -> None:
    file = written(tmp_path, 1, times)
    with twin(tmp_path, unit) as base:
        result = base.run(file)
        assert not [one for one in base.doctor(file).findings if one.kind == "unit"]
    assert "he stamps look" not in result.headline and result.of_kind("tuned")
