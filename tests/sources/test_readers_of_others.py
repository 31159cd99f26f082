"""Readers that other packages register by the ending of their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from evertwin.errors import DataError
from evertwin.sources import Recording, inspect, open_recording, recording


class Point:
    """An entry point, as ``importlib.metadata`` gives it."""

    def __init__(self, reader: Any) -> None:
        self.reader = reader

    def load(self) -> Any:
        return self.reader


def registered(monkeypatch: pytest.MonkeyPatch, reader: Any) -> None:
    def points(group: str, name: str) -> list[Point]:
        assert group == "evertwin.sources"
        return [Point(reader)] if name == "log7" else []

    monkeypatch.setattr(recording, "entry_points", points)


def test_a_registered_ending_is_opened_by_its_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "plain.csv").write_text("t,x\n0,1\n1,2\n2,3\n")
    (tmp_path / "run.log7").write_bytes(b"\x00\x01\x02")

    def opened(path: Path) -> Recording:
        return open_recording(path.with_name("plain.csv"))

    registered(monkeypatch, opened)
    assert inspect(tmp_path / "run.log7").tables[0].rows == 3


def test_a_reader_that_gives_something_else_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.log7").write_bytes(b"\x00\x01\x02")
    registered(monkeypatch, lambda path: [path])
    with pytest.raises(DataError, match=r"gave list, expected evertwin\.sources\.Recording"):
        open_recording(tmp_path / "run.log7")


def test_other_unknown_files_stay_unknown(tmp_path: Path) -> None:
    (tmp_path / "run.log8").write_bytes(b"\x00\x01\x02")
    with pytest.raises(DataError, match="unknown binary file"):
        open_recording(tmp_path / "run.log8")
