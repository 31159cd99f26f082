"""What spreadsheets write and nobody can read in one way is refused, and says what to write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError, UsageError
from evertwin.prognosis.laws.series.indicator import Direction
from evertwin.prognosis.outlook.lone_series import Series, life_of_series

WORN = 2.0 + 0.05 * np.arange(40) + 0.02 * np.sin(7.0 * np.arange(40))


def table(folder: Path, head: str, row: str, values: np.ndarray = WORN) -> Path:
    file = folder / "h.csv"
    rows = [row.format(k=k, v=v, d=46027 + k, h=k % 24) for k, v in enumerate(values)]
    file.write_text(head + "\n" + "\n".join(rows) + "\n")
    return file


@pytest.mark.parametrize(
    ("head", "row", "said"),
    [
        ("Date,wear", "{d},{v:.3f}", r"h\.csv:2: Date: expected dates .*46027: .*for 2026-01-05"),
        ("Datum;wear", "{d}.25;{v:.3f}", r"h\.csv:2: Datum: expected dates .* for 2026-01-05"),
        ("Report of line 3;;\nrun;wear;note", "{k};{v:.3f};", "they seem to stand in line 2"),
        ("Report of line 3\n\nrun;wear", "{k};{v:.3f}", "they seem to stand in line 3"),
        ("1,2.05", "{k},{v:.3f}", r"h\.csv:1: expected headings in the first line, got '1,2\.05'"),
        ("2026-01-05,2.05", "{k},{v:.3f}", "write a line of headings above it"),
        ("run;wear", "{k};2.{k:03d},0", r"got '2\.000,0': write 2000\.0, without thousands"),
        ("run,wear", "{k},{v:.3f}%", r"'2\.000%': write 2\.000, and the unit in .*: wear \[%\]"),
    ],
)
def test_what_to_write_is_said(head: str, row: str, said: str, tmp_path: Path) -> None:
    file = table(tmp_path, head, row)
    for column in ("", "wear"):
        with pytest.raises(DataError, match=said):
            life_of_series(Series(file, 5.0, column=column))


def test_headings_that_look_odd_are_read(tmp_path: Path) -> None:
    for head, row in ((",wear", "{k},{v:.3f}"), ("run;wear;note", "{k};{v:.3f};"),
                      ("run,wear,Date", "{k},{v:.3f},{d}")):  # fmt: skip
        found = life_of_series(Series(table(tmp_path, head, row), 5.0))
        assert 10.0 < found.components["wear"].urgency < 40.0, head


@pytest.mark.parametrize(
    "head", ["flight", "pieces", "passes", "time_cycles", "runtime_h", "t_min", "age_days"]
)
def test_what_is_counted_is_the_clock(head: str, tmp_path: Path) -> None:
    row = "{k}0,{v:.3f}"  # rows of ten
    found = life_of_series(Series(table(tmp_path, f"{head},wear", row), 5.0, column="wear"))
    assert "rows were counted" not in str(found)
    counted = found.components["wear"].urgency * (60.0 if head == "t_min" else 1.0)  # of hours
    assert 90.0 < counted < 420.0


@pytest.mark.parametrize("again", [[2, 2], [2, 3, 2, 3]])
@pytest.mark.parametrize("zone", ["", "+02:00"])
def test_the_hour_that_comes_twice_asks_for_a_zone(
    zone: str, again: list[int], tmp_path: Path
) -> None:
    file = table(tmp_path, "time,wear", "2026-10-24 {h:02d}:00,{v:.3f}", WORN[:24])
    hours = ["00:00", "01:00", *(f"0{1 + h // 2}:{30 * (h % 2):02d}" for h in again), "04:00"]
    late = [f"2026-10-25 {h}{zone},{3.2 + 0.05 * k:.3f}" for k, h in enumerate(hours)]
    text = file.read_text()
    early = text if not zone else text.replace(":00,", f":00{zone},")
    file.write_text(early + "\n".join(late) + "\n")
    with pytest.raises(DataError) as error:
        life_of_series(Series(file, 5.0))
    asked = "was the clock set back there? Write dates in UTC, or with their zone"
    assert (asked in str(error.value)) == (not zone)
    assert ("write their mean" in str(error.value)) == bool(zone)


@pytest.mark.parametrize(
    ("head", "size", "limit", "direction", "other"),
    [
        ("run,SoH [%]", 100.0, "0.8", "below", "80"),
        ("run,SoH", 100.0, "0.8", "below", "80"),
        ("run,SoH", 1.0, "80", "below", "0.8"),
        ("run,SoH [%]", 100.0, "0.8 %", "below", ""),
        ("run,SoH", 1.0, "0.8", "below", ""),
        ("run,pad", 60.0, "0.8", "below", ""),
        ("run,crack", 1.0, "20", "above", ""),
    ],
)
def test_a_share_beside_per_cent_is_asked_back(
    head: str, size: float, limit: str, direction: Direction, other: str, tmp_path: Path
) -> None:
    sign = -1.0 if direction == "below" else 1.0
    file = table(tmp_path, head, "{k},{v:.5f}", size * (1.0 + 0.04 * sign * (WORN - 2.0)))
    asked = Series(file, limit, direction)
    if other:
        with pytest.raises(UsageError, match=f"values begin at .*: is it {other} in their unit"):
            life_of_series(asked)
    else:
        assert life_of_series(asked).components


@pytest.mark.parametrize("head", ["cut", "valve openings", "Odometer km", "distance [km]"])
def test_a_counter_of_any_name_is_the_clock_once_the_values_are_named(
    head: str, tmp_path: Path
) -> None:
    file = table(tmp_path, f"{head},wear", "{k}5,{v:.3f}")  # rows of ten
    found = life_of_series(Series(file, 5.0, column="wear"))
    assert 90.0 < found.components["wear"].urgency < 420.0
    assert found.clock == head.split(" [")[0]


def test_which_of_two_columns_that_rise_is_the_counter_is_asked(tmp_path: Path) -> None:
    file = table(tmp_path, "cut,wear", "{k}5,{v:.3f}")
    with pytest.raises(UsageError, match="life is counted by cut, which rises with every row"):
        life_of_series(Series(file, 5.0))
    dated = table(tmp_path, "lot,day,wear", "{k}5,2026-03-01 {h:02d}:00,{v:.3f}", WORN[:24])
    assert life_of_series(Series(dated, 5.0, column="wear")).clock == "h"


def test_a_limit_far_beyond_all_growth_is_asked_back(tmp_path: Path) -> None:
    file = table(tmp_path, "run,wear", "{k},{v:.3f}", 0.01 + 5.0 * (WORN - 2.0))
    with pytest.raises(DataError, match=r"the limit is 15000: .* times as much"):
        life_of_series(Series(file, 15000.0))
    assert life_of_series(Series(file, 15.0)).components


def test_growth_that_is_seen_and_too_little_yet_is_told_as_such(tmp_path: Path) -> None:
    file = table(tmp_path, "run,wear", "{k},{v:.3f}")
    assert "it has grown by 1.3" in str(life_of_series(Series(file, 60.0)))
