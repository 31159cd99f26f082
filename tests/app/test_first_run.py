"""The first run of a proposed twin file says what it needs; a second clock drives nothing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.config import read


def ended(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return int(left.value.code or 0)


def proposed(folder: Path) -> Path:
    t = 0.1 * np.arange(300)
    columns = np.c_[t, t + 0.3, np.sin(t), np.cos(t)]
    np.savetxt(
        folder / "run.csv", columns, "%.6f", ",", comments="",
        header="t [s],device_time [s],u,y",
    )  # fmt: skip
    assert ended(["init", str(folder / "run.csv"), "-o", str(folder / "t.toml")]) == 0
    return folder / "t.toml"


def test_a_run_without_a_requirement_says_what_to_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin = proposed(tmp_path)
    text = re.sub(r"\nrequirement = .*", "", twin.read_text())
    twin.write_text(text)
    assert ended(["doctor", str(twin)]) == 1
    assert "1 finding" not in (said := capsys.readouterr().out)
    assert said.partition(" rows, ")[2].splitlines()[1].startswith("not_asked: no requirement")
    assert ended(["run", str(twin)]) == 0
    assert "set [anomaly] requirement" in capsys.readouterr().err
    twin.write_text(text.replace("[anomaly]", "[anomaly]\nrequirement = 1e9"))
    assert ended(["run", str(twin)]) == 0
    assert "requirement" not in capsys.readouterr().err


def test_a_second_clock_is_no_input(tmp_path: Path) -> None:
    channels = read(proposed(tmp_path)).source[0].channels
    assert {name: c.column for name, c in channels.items()} == {"u": "u", "y": "y"}
