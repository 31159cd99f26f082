"""Limits with units, headings of what is counted, units of headings: as people write them."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError, UsageError
from evertwin.prognosis.outlook.lives import Lives
from evertwin.prognosis.outlook.lone_series import Series, life_of_series, wear_in
from evertwin.signals.units import compatible, conversion, si_unit
from planted.draws import first_of


def worn(folder: Path, heading: str, size: float = 1.0, step: int = 1, seed: int = 1) -> Path:
    """A series that reaches 0.3 after 60 of its rows, by what stands in the first column."""
    rng = np.random.default_rng(seed)
    value = size * (0.1 + 0.2 * np.arange(45) / 60 + rng.normal(0.0, 0.002, 45))
    file = folder / "tool.csv"
    rows = [f"{step * k},{v:.6g}" for k, v in enumerate(value)]
    file.write_text("\n".join([heading, *rows]) + "\n")
    return file


def life(file: Path, limit: float | str) -> Lives:
    return life_of_series(Series(file, limit))


@pytest.mark.parametrize(
    ("heading", "size", "said", "limit"),
    [
        ("run,VB [mm]", 1.0, "0.3", 0.3),
        ("run,VB [mm]", 1.0, "300 um", 0.3),
        ("run,VB [um]", 1000.0, "0.3 mm", 300.0),
        ("run,flank_wear_um", 1000.0, "0.3 mm", 300.0),
        ("run,capacity(mAh)", 1000.0, "0.3 Ah", 300.0),
        ("run,r_mOhm", 1000.0, "0.3 Ohm", 300.0),
        ("run,share [%]", 100.0, "30 %", 30.0),
        ("run,share [1]", 1.0, "30 %", 0.3),
    ],
)
def test_a_limit_may_have_its_own_unit(
    heading: str, size: float, said: str, limit: float, tmp_path: Path
) -> None:
    found = life(worn(tmp_path, heading, size), said)
    plain = life(worn(tmp_path, heading, size), limit)
    (one,) = found.components.values()
    assert one.indicator.limit.value == pytest.approx(limit)
    assert one.urgency == pytest.approx(next(iter(plain.components.values())).urgency)


@pytest.mark.parametrize(
    ("heading", "said", "reason"),
    [
        ("run,VB [mm]", "3 V", "--limit '3 V': expected a unit like 'mm', got 'V'"),
        ("run,VB", "0.3 mm", "a number alone, for VB states no unit"),
        ("run,VB [mm]", "300 %", r"of what\?.* of the first VB, 0\.1.*, it is --limit 0\.3"),
        ("run,VB", "soon", "--limit: expected a number or text such as '2 cm', got 'soon'"),
    ],
)  # fmt: skip
def test_a_limit_that_is_none_is_refused(
    heading: str, said: str, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=reason):
        life(worn(tmp_path, heading), said)


@pytest.mark.parametrize(
    ("heading", "clock"),
    [
        ("cycle_number", "cycle"), ("cycles", "cycle"), ("Cycle_Index", "cycle"),
        ("id_cycle", "cycle"), ("Cycle No.", "cycle"), ("run_no", "run"), ("N", "run"),
        ("hours", "h"), ("operating_hours", "h"), ("Betriebsstunden", "h"), ("day", "d"),
        ("days", "d"), ("hours [h]", "h"), ("days [h]", "d"),
    ],
)  # fmt: skip
@first_of("seed", [1, 2, 3])
def test_a_heading_says_what_is_counted(
    heading: str, clock: str, seed: int, tmp_path: Path
) -> None:
    file = worn(tmp_path, f"{heading},VB [mm]", step=10, seed=seed)
    found = life(file, 0.3)
    (one,) = found.components.values()
    assert found.clock == clock and not found.notes
    per = 240.0 if heading == "days [h]" else 10.0
    assert one.indicator.at[-1] == pytest.approx(44 * (10.0 if per == 10.0 else 10.0 / 24))
    assert wear_in(file) is not None or clock == "run"


def test_what_only_numbers_rows_is_no_value_and_no_wear(tmp_path: Path) -> None:
    """As before: a table that numbers its rows may be anything; a diameter is no day."""
    assert wear_in(worn(tmp_path, "index,VB")) is None
    file = worn(tmp_path, "cut,diameters [mm]", step=10)
    with pytest.raises(UsageError, match="got cut, diameters"):
        life(file, 0.3)
    by_row = life(worn(tmp_path, "cut,VB [mm]"), 0.3)  # each cut has its row
    assert by_row.clock == "run" and "its 45 rows were counted" in by_row.notes[0]


@pytest.mark.parametrize(
    ("unit", "like", "factor"),
    [("Ohm", "ohm", 1.0), ("mOhm", "ohm", 1e-3), ("kOhm", "V/A", 1e3), ("-", "1", 1.0),
     ("a.u.", "1", 1.0), ("Ohms", "ohm", 1.0)],
)  # fmt: skip
def test_units_of_headings(unit: str, like: str, factor: float) -> None:
    assert conversion(unit) == pytest.approx((factor, 0.0)) and compatible(unit, like)
    assert like != "1" or si_unit(unit) == "1"


@pytest.mark.parametrize("ahead", [1, 2])
def test_a_date_ahead_of_today_is_said_to_be_one(ahead: int, tmp_path: Path) -> None:
    today = dt.date.today()
    days = [today + dt.timedelta(days=k - 60) for k in range(50)]
    days += [today + dt.timedelta(days=30 + k) for k in range(ahead)]
    rows = [f"{day},{0.1 + 0.003 * k:.4f}" for k, day in enumerate(days)]
    file = tmp_path / "pump.csv"
    file.write_text("\n".join(["date,vibration", *rows]) + "\n")
    with pytest.raises(DataError, match="ahead of today: correct it") as refused:
        life(file, 0.4)
    assert f"({days[0]} to {days[49]}), got {days[50]}, which lies ahead" in str(refused.value)
