"""While slow work brings no row, the terminal says so."""

from __future__ import annotations

import sys
import time

import pytest

from evertwin.app.console import Progress


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
