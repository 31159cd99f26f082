"""Steps that wear does not take are asked back with their rows, or told; no healthy machine is."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.errors import DataError
from evertwin.prognosis.histories.steps import back_of, check_steps, shift_of
from evertwin.prognosis.laws import Indicator, Limit
from evertwin.prognosis.laws.series.indicator import Direction
from evertwin.prognosis.outlook.lone_series import Series, life_of_series
from evertwin.types import Vector

SEEDS = range(4)


def written(file: Path, value: Vector, marks: dict[int, str] | None = None) -> Path:
    rows = [f"{k},{v:.5f},{(marks or {}).get(k, '')}" for k, v in enumerate(value)]
    file.write_text("run,x,maintenance\n" + "\n".join(rows) + "\n")
    return file


def pads(seed: int) -> Vector:
    """Two sets worn from 12 to 3.2 mm, and a third one almost."""
    rng = np.random.default_rng(seed)
    worn = np.linspace(12.0, 3.2, 90)
    return np.concatenate([worn, worn, worn[:80]]) + 0.08 * rng.standard_normal(260)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_part_that_was_replaced_and_not_marked_is_asked_back(seed: int, tmp_path: Path) -> None:
    file = written(tmp_path / "pads.csv", pads(seed))
    with pytest.raises(DataError, match=r"pads\.csv:92: x: .*at 182: was the part replaced there"):
        life_of_series(Series(file, 3.0, "below"))
    rule = spec.IndicatorSpec("x", file="pads.csv", limit=3.0, direction="below")
    twin = TwinSpec("cart", spec.ModelSpec("robot1d"), indicator=(rule,), folder=str(tmp_path))
    with pytest.raises(DataError, match=r"pads\.csv:92: x: "):
        Twin(twin).life()
    written(file, pads(seed), {90: "replaced", 181: "replaced"})  # beside its row is near enough
    assert life_of_series(Series(file, 3.0, "below")).components["x"].urgency < 30.0
    written(file, pads(seed), {90: "replaced"})
    with pytest.raises(DataError, match=r"pads\.csv:182: x: "):
        life_of_series(Series(file, 3.0, "below"))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("factor", "added"),
    [(0.1, 0.0), (1 / 25.4, 0.0), (1 / 2.2, 0.0), (10.0, 0.0), (14.5038, 0.0), (1.8, 32.0)],
)
def test_another_unit_from_a_row_on_is_asked_back(
    seed: int, factor: float, added: float, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    y = 2.0 + 0.05 * np.arange(45) + 0.05 * rng.standard_normal(45)
    y[20:] = factor * y[20:] + added
    with pytest.raises(DataError, match=r"h\.csv:22: x: .* is it in another unit"):
        life_of_series(Series(written(tmp_path / "h.csv", y), 5.0))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("pace", [0.0, 0.01])
def test_a_shift_is_told_with_the_life_that_another_sensor_would_mean(
    seed: int, pace: float, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    y = 2.0 + pace * np.arange(100) + 0.04 * rng.standard_normal(100)
    y[60:] += 1.2
    file = written(tmp_path / "h.csv", y)
    (note,) = life_of_series(Series(file, 5.0)).notes
    assert "at once in row 62" in note and "was its sensor exchanged" in note
    found = life_of_series(Series(written(file, y, {60: "adjusted"}), 5.0))
    assert note.endswith(found.components["x"].sentence) and not found.notes


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scale", [0.01, 300.0])
@pytest.mark.parametrize("part", [0.25, 0.4])
def test_a_step_that_is_not_large_is_told_where_it_is_clear(
    seed: int, scale: float, part: float, tmp_path: Path
) -> None:
    """By a share of the way to the limit: back to the begin, and towards the limit."""
    rng, file = np.random.default_rng(seed), tmp_path / "h.csv"
    y = 5.0 + 7.0 * part * np.arange(60) / 40 + 7.0 * 0.006 * rng.standard_normal(60)
    back, shift = (y + np.where(np.arange(60) < 40, 0.0, 7.0 * one) for one in (-part, part))
    asked = Series(file, scale * 12.0)
    written(file, scale * back)
    (note,) = [one for one in life_of_series(asked).notes if "steps back" in one]
    assert "in row 42: was the part replaced there?" in note
    assert not life_of_series(replace(asked, file=written(file, scale * y))).notes
    written(file, scale * back, {40: "replaced"})
    assert not any("steps back" in one for one in life_of_series(asked).notes)
    written(file, scale * shift)
    (note,) = life_of_series(asked).notes
    assert "at once in row 42" in note and "adjusted" in note


def own(y: Vector, limit: float, direction: Direction = "above") -> Indicator:
    return Indicator.of("x", "1", Limit(limit, direction), np.arange(float(len(y))), y)


def drawn(seed: int, n: int) -> Iterator[Indicator]:
    """Healthy wear: of many shapes, by chance, cells that recover, filters that are cleaned."""
    rng = np.random.default_rng([seed, n])
    u = np.arange(n) / n
    shapes = (u, u**4, u**0.5, np.expm1(6.0 * u) / np.expm1(6.0), 0.05 * u / (1.0 - 0.95 * u))
    for noise in (0.003, 0.02, 0.08):
        for shape in shapes:
            level = 1.0 + 4.0 * shape
            yield own(level + 4.0 * noise * rng.standard_normal(n), 5.0)
            yield own(level * np.exp(noise * rng.standard_normal(n)), 5.0)
    yield own(2.0 + 3.0 * np.cumsum(rng.gamma(1.0, 1.0, n)) / n, 5.0)
    yield own(2.0 + 3.0 * u + 0.05 * rng.standard_t(2, n), 5.0)
    cell = 2.0 - 0.8 * u + 0.004 * rng.standard_normal(n)
    for k in rng.integers(0, n, 8).tolist():
        cell[k:] += rng.uniform(0.02, 0.12) * np.exp(-np.arange(n - k) / rng.uniform(3.0, 20.0))
    yield own(cell, 1.2, "below")
    saw = (u / rng.uniform(0.06, 0.3)) % 1.0
    filled = 0.65 * u**1.5 + rng.uniform(0.1, 0.35) * saw
    yield own(100.0 + 800.0 * filled + 8.0 * rng.standard_normal(n), 900.0)


@pytest.mark.parametrize("n", [40, 300])
def test_healthy_wear_is_not_asked_back(n: int) -> None:
    for seed in range(10):
        for one in drawn(seed, n):
            for share in (0.4, 0.7, 1.0):
                part = one.until(share * n)
                check_steps(part, "h.csv", range(n))
                assert shift_of(part) is None, seed


def column(file: Path, name: str, of: tuple[str, str] | None = None) -> Vector:
    with file.open(newline="", encoding="utf-8") as rows:
        return np.array(
            [float(r[name]) for r in csv.DictReader(rows) if not of or r[of[0]] == of[1]]
        )


def recorded(folder: Path) -> Iterator[Indicator]:
    for cell in ("B0005", "B0006", "B0007", "B0018"):
        file = folder / "battery/capacity.csv"
        yield own(column(file, "capacity_Ah", ("battery", cell)), 1.4, "below")
    for k in (1, 9, 40, 90):
        file = folder / "battery_fleet/capacity.csv"
        yield own(column(file, "capacity_Ah", ("cell", str(k))), 0.88, "below")
    for file in sorted((folder / "bearing_femto").glob("*.csv")):
        for name in ("rms_h_g", "rms_v_g", "peak_h_g", "kurt_h"):
            y = column(file, name)
            yield own(y, 3.0 * float(np.median(y[:50])))
    for k, file in enumerate(sorted(folder.glob("bearing_ims[12]/*.csv"))):
        for name in ("Bearing 1-A", "Bearing 3-A", "Bearing 4-B") if k == 0 else ("Bearing 1",):
            y = column(file, name)
            yield own(y, 3.0 * float(np.median(y[:144])))


def test_recorded_machines_are_not_asked_back(data_dir: Path) -> None:
    for one in recorded(data_dir):
        for share in np.linspace(0.05, 1.0, 20):
            part = one.until(float(share) * len(one.at))
            check_steps(part, "h.csv", range(len(one.at)))
            assert shift_of(part) is None and back_of(part) is None


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("level", [0.01, 0.07])
def test_a_machine_that_stood_still_goes_on(seed: int, level: float, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    shaking = 2.0 * np.exp(0.05 * rng.standard_normal(200)) * (1.0 + (np.arange(200) / 150.0) ** 6)
    for stop in (40, 90, 150):
        shaking[stop : stop + 12] = level * rng.uniform(0.5, 1.0, 12)
    for rows in (100, 160, 200):
        told = life_of_series(Series(written(tmp_path / "rms.csv", shaking[:rows]), 14.2))
        assert not any("shifts" in note for note in told.notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_steep_begin_and_a_gap_are_no_replaced_part(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at = np.r_[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 60.0 + 10.0 * np.arange(20)]
    falls = np.r_[900.0, 790.0, 680.0, 570.0, 460.0, 380.0, np.linspace(360.0, 150.0, 20)]
    own = Indicator.of("R", "MOhm", Limit(5.0, "below"), at, falls + rng.normal(0.0, 4.0, 26))
    check_steps(own, "r.csv", range(2, 28))
