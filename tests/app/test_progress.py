"""While slow work brings no row, the terminal says so."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from evertwin.app.console import Progress
from evertwin.app.first import init_command as starting
from evertwin.app.outlook import life_of_series as lone_life
from evertwin.app.outlook import outlook_commands as prognosis


def test_silence_is_told_of_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(Progress, "SILENT", 0.5)
    progress = Progress()
    progress(1400, 70.0)
    until = time.monotonic() + 10.0
    said = ""
    while "at work" not in said and time.monotonic() < until:
        time.sleep(0.2)
        said += capsys.readouterr().err
    progress.close()
    assert "1,400 rows, 70 s of data; at work on what they tell for" in said


class _Ended(Exception):
    pass


def _slow(*_: object, **__: object) -> NoReturn:
    time.sleep(1.5)
    raise _Ended


class _SlowTwin:
    def __enter__(self) -> _SlowTwin:
        return self

    def __exit__(self, *_: object) -> None: ...

    whatif = life = forecast = plan = _slow


NONE: tuple[Any, Any] = (None, None)
COMMANDS: dict[str, Callable[[Path], object]] = {
    "init": lambda file: starting.write_starter([file], None, ("robot1d", None), False, False),
    "life of a series": lambda file: lone_life.show_series(
        file, ("1.4", False, "", False), NONE, None, False, False
    ),
    "life": lambda file: prognosis.show_life(file, NONE, (None, False), False, False),
    "whatif": lambda file: prognosis.show_whatif(file, file, NONE, False, False),
    "plan": lambda file: prognosis.show_plan(file, NONE, None, None, False),
    "forecast": lambda file: prognosis.show_forecast(file, "1 s", None, NONE, False),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_is_silent_for_long_on_a_terminal(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (file := tmp_path / "run.csv").write_text("t,x\n0,1\n1,2\n")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(Progress, "SILENT", 0.5)
    monkeypatch.setattr(starting, "look", _slow)
    monkeypatch.setattr(lone_life, "life_of_series", _slow)
    monkeypatch.setattr(prognosis, "Twin", lambda *_, **__: _SlowTwin())
    monkeypatch.setattr(prognosis, "to_work", lambda *_: _SlowTwin())
    monkeypatch.setattr(prognosis, "as_kept", lambda path: path)
    with pytest.raises(_Ended):
        COMMANDS[command](file)
    said = capsys.readouterr().err
    assert "; at work on what they tell for 1 s" in said and said.endswith("\n")
