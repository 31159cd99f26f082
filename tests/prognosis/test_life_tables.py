"""Tables of a life as people write them: what counts, what is a value, and what is asked back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.prognosis.outlook.lone_series import Series, life_of_series, wear_in

N = 80
DAYS = [f"{np.datetime64('2025-01-01T07:00') + np.timedelta64(7 * k, 'h')}" for k in range(N)]


def wear(seed: int, until: float = 9.0) -> np.ndarray:
    return 1.0 + until * np.arange(N) / N + np.random.default_rng(seed).normal(0, 0.1, N)


def table(file: Path, head: str, *columns: object) -> Path:
    rows = zip(*columns, strict=True)  # type: ignore[call-overload]
    file.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows), ""]))
    return file


@pytest.mark.parametrize(
    ("head", "clock", "step"),
    [("minutes", "h", 1 / 60), ("week", "d", 7.0), ("km", "km", 1.0),
     ("operating hours", "h", 1.0)],
)  # fmt: skip
@pytest.mark.parametrize("seed", range(3))
def test_minutes_weeks_and_kilometres_count(
    tmp_path: Path, head: str, clock: str, step: float, seed: int
) -> None:
    count = 5 * np.arange(N)
    lives = life_of_series(Series(table(tmp_path / "a.csv", f"{head},x", count, wear(seed)), 20.0))
    assert lives.clock == clock
    true = step * 5 * N * 10.0 / 9.0
    assert 0.3 * true < lives.components["x"].urgency < 3.0 * true


def test_a_temperature_is_no_time_and_what_is_constant_no_value(tmp_path: Path) -> None:
    rows = range(N), ["1"] * N, wear(0)
    for head in ("h,case,T [degC]", "h,case,t [degC]"):
        told = wear_in(table(tmp_path / "a.csv", head, *rows))
        assert told is not None
        assert (told.clock, told.columns) == ("h", (head[-8],))
    units = [1 + k // 40 for k in range(N)]
    told = wear_in(table(tmp_path / "a.csv", "unit,cycle,T50,P30", units, range(N), *[wear(0)] * 2))
    assert told is not None
    assert told.columns == ("T50", "P30")


def test_dates_and_times_of_day_in_two_columns_are_one(tmp_path: Path) -> None:
    days, times = zip(*(day.split("T") for day in DAYS), strict=True)
    two = table(tmp_path / "two.csv", "Date,Time,x", days, times, wear(0))
    one = table(tmp_path / "one.csv", "Date,x", DAYS, wear(0))
    first, second = (life_of_series(Series(file, 20.0)) for file in (one, two))
    assert first.components["x"].urgency == second.components["x"].urgency


@pytest.mark.parametrize("said", ["C2H4 [ppm]", "C2H4", "H2 (ppm)", "H2"])
def test_a_column_by_its_heading_whole_or_without_its_unit(tmp_path: Path, said: str) -> None:
    file = table(tmp_path / "a.csv", "h,C2H4 [ppm],H2 (ppm)", range(N), wear(0), wear(1))
    (name,) = life_of_series(Series(file, 20.0, column=said)).components
    assert name.startswith(said[:2])


@pytest.mark.parametrize("seed", range(3))
def test_a_limit_on_the_side_that_values_move_away_from_is_asked_back(
    tmp_path: Path, seed: int
) -> None:
    file = table(tmp_path / "a.csv", "h,x", range(N), wear(seed, -0.8))
    assert "moves away from its limit 2 (above)" in str(life_of_series(Series(file, 2.0)))
    file = table(tmp_path / "a.csv", "h,x", range(N), wear(seed))
    assert "moves away" not in str(life_of_series(Series(file, 20.0)))


@pytest.mark.parametrize("factor", [1.0, 25.4, 1 / 25.4, 1000.0])
@pytest.mark.parametrize("many", [1, 3, 5])
def test_like_machines_in_another_unit_are_asked_back(
    tmp_path: Path, factor: float, many: int
) -> None:
    fleet = tuple(
        table(tmp_path / f"f{k}.csv", "h,x", (1 + 0.1 * k) * np.arange(N),
              wear(k, 10.0) * (factor if k < many else 1.0))
        for k in range(6)
    )  # fmt: skip
    asked = Series(table(tmp_path / "u.csv", "h,x", range(N), wear(9, 5.0)), 10.0, fleet=fleet)
    if factor == 1.0:
        life_of_series(asked)
    else:
        with pytest.raises(DataError, match=r"f0.csv: x: begins at .* is it in another unit"):
            life_of_series(asked)


@pytest.mark.parametrize("unit", ["%", "mm", "kNm"])
def test_like_machines_with_a_unit_beside_one_without_are_read_as_written(
    tmp_path: Path, unit: str
) -> None:
    heads = ("h,x", f"h,x [{unit}]")
    fleet = tuple(
        table(tmp_path / f"f{k}.csv", heads[k % 2], (1 + 0.1 * k) * np.arange(N), wear(k, 10.0))
        for k in range(6)
    )
    asked = table(tmp_path / "u.csv", "h,x", range(N), wear(9, 5.0))
    told = life_of_series(Series(asked, 10.0, fleet=fleet)).to_dict()["components"]["x"]
    assert all(one["how"] == "limit" and one["age"] > 50.0 for one in told["fleet"])


def test_a_recording_in_which_nothing_goes_one_way_tells_no_wear(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    wind, oil = rng.normal(8.0, 2.0, N), rng.normal(50.0, 5.0, N)
    assert wear_in(table(tmp_path / "a.csv", "Date,wind,oil", DAYS, wind, oil)) is None
    found = wear_in(table(tmp_path / "b.csv", "Date,wind,gap", DAYS, wind, wear(0)))
    assert found is not None and found.columns == ("gap", "wind") and not found.falls


def test_a_life_told_alone_says_what_it_cannot_foretell(tmp_path: Path) -> None:
    file = tmp_path / "vibration.csv"
    file.write_text("d,vibration\n" + "".join(f"{k},{2.0 + 0.01 * k}\n" for k in range(120)))
    lives = life_of_series(Series(file, 4.5))
    assert "nothing foretells one that comes at once" in str(lives)
    assert lives.components["vibration"].urgency < np.inf
    over = str(life_of_series(Series(file, 3.0)))
    assert "life is over" in over and "foretells" not in over
