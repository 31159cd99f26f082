"""Stamps a thousand, million or milliard times too large are named in what each twin file says."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin
from evertwin.errors import EvertwinError
from evertwin.worlds.robot import main as drive
from planted.draws import first_of

TWINS = Path(__file__).parents[2] / "twins"
FINER = {3: "ms", 6: "us", 9: "ns"}
FIRST = 150
"""Rows of a recording that are read."""


def scaled(file: Path, to: Path, power: int, separator: str, head: int) -> list[Path]:
    """The first rows of a file, its first column times 10^power, to the last digit."""
    with file.open(encoding="utf-8", newline="") as read, to.open("w", newline="") as write:
        rows, out = csv.reader(read, delimiter=separator), csv.writer(write, delimiter=separator)
        for number, row in enumerate(islice(rows, FIRST + head)):
            first = row[0] if number < head else f"{Decimal(row[0]).scaleb(power):f}"
            out.writerow([first, *row[1:]])
    return [to]


@pytest.fixture
def recordings(tmp_path: Path, data_set: Callable[[str], Path]) -> Callable[[str, int], list[Path]]:
    def of(name: str, power: int) -> list[Path]:
        to = tmp_path / f"{name}.csv"
        if name == "ur10e":
            return scaled(next(folder("ur10e/identification")), to, power, ",", 0)
        if name == "robotino":
            return scaled(next(folder("robotino/gray")), to, power, ";", 3)
        own = tmp_path / "own.csv"
        drive(["--seed", "5", "--out", str(own), *["--light"] * (name == "robot1d")])
        return scaled(own, to, power, ",", 1)

    def folder(name: str) -> Iterator[Path]:
        return iter(sorted(data_set(name).glob("*.csv")))

    return of


def said(name: str, command: str, files: list[Path]) -> str:
    """What a command says of a shipped file's twin; or why it says nothing."""
    with Twin.open(TWINS / f"{name}.toml") as twin:
        call: Callable[[Any], Any] = getattr(twin, command)
        try:
            found = call(files)
        except EvertwinError as error:
            return str(error)
        lost = getattr(found, "left_out", ())
        assert all(one.finding for one in lost) and (lost or found.findings)
        return str(found)


DRAWN = [(name, power) for name in ("robot1d", "ur10e", "robot") for power in (9, 3, 6)]


@first_of(("name", "power"), [*DRAWN, ("robotino", 3), ("robotino", 6)])
def test_a_unit_of_stamps_that_a_heading_hides_is_named(
    name: str, power: int, recordings: Callable[[str, int], list[Path]]
) -> None:
    files = recordings(name, power)
    read, more = ("ms", 3) if name == "robotino" else ("s", 0)
    unit = FINER[power + more]
    for command in ("run", "fit", "doctor"):
        told = said(name, command, files)
        named = f"stamps {unit}", f"stamps look like {unit}", f"time: {unit}"
        assert any(one in told for one in named) and f"read as {read}" in told, told


@first_of("name", ["robotino", "robot1d"])
def test_stamps_that_are_what_the_file_says_raise_no_question(
    name: str, recordings: Callable[[str, int], list[Path]]
) -> None:
    with Twin.open(TWINS / f"{name}.toml") as twin:
        assert not twin.run(recordings(name, 0)).left_out


def test_stamps_of_a_second_with_decimals_are_none_of_milliseconds(tmp_path: Path) -> None:
    """A scattered row a second, predicted a second ahead."""
    rng, file = np.random.default_rng(3), tmp_path / "scattered.csv"
    t = np.arange(300) + rng.normal(0.003, 0.01, 300)
    v = np.repeat(rng.uniform(0.0, 20.0, 30), 10)
    rows = np.column_stack([t, v, np.concatenate([[0.0], np.cumsum(v[:-1])])])
    np.savetxt(file, rows, delimiter=",", header="t [s],v_cmd [cm/s],x [cm]", comments="")
    with Twin.open(TWINS / "robot1d.toml") as twin:
        assert not twin.run(file).left_out
