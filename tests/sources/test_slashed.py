"""Units behind a slash in headings, and slashes that part something else."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.sources.columns.names import split_unit
from evertwin.sources.texts.text import TextTable


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("flow/(l/min)", "flow", "l/min"), ("T_in/degC", "T_in", "degC"), ("U/V", "U", "V"),
        ("T / °C", "T", "°C"), ("v / m/s", "v", "m/s"), ("Zeit/s", "Zeit", "s"),
        ("t / ms", "t", "ms"), ("Kraft/N", "Kraft", "N"), ("n/(1/min)", "n", "1/min"),
    ],
)  # fmt: skip
def test_a_unit_behind_a_slash(heading: str, name: str, unit: str) -> None:
    assert split_unit(heading) == (name, unit)


@pytest.mark.parametrize(
    "heading",
    ["m/s", "km/h", "speed km/h", "V/s", "N/mm", "stiffness N/mm", "sensor/A", "I/O", "S/N",
     "left/right", "ticks/s", "Date/Time", "U/min"],
)  # fmt: skip
def test_a_slash_that_parts_something_else(heading: str) -> None:
    assert split_unit(heading) == (heading, "")


def test_two_units_of_one_name_stay_apart_and_the_heading_names_a_column_too(
    tmp_path: Path,
) -> None:
    file = tmp_path / "run.csv"
    file.write_text("t/s,motor/rpm,motor/mA,flow/(l/min)\n0,1,2,3\n1,2,3,4\n")
    found = TextTable(file).columns
    assert [c.name for c in found] == ["t", "motor/rpm", "motor/mA", "flow"]
    assert [c.unit for c in found] == ["s", "rpm", "mA", "l/min"]
    assert found[3].also == ("flow/(l/min)", "flow/")
