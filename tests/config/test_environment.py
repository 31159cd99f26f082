"""``${NAME}`` stands in any text: a quantity with its unit, a length of the stream, a word."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.config import read
from evertwin.errors import ConfigError
from evertwin.fold.span import Span

TEXT = """schema = 1
name = "cart"
beat = "${BEAT:-200}"
[model]
kind = "robot1d"
parameters.gain = { value = "${GAIN:-0.9} 1" }
[prediction]
horizon = "${SECONDS_AHEAD:-1} s"
[anomaly]
requirement = "${LIMIT:-6} mm"
[tuning]
method = "${METHOD:-auto}"
window = "${WINDOW:-30 s}"
"""


def written(folder: Path, text: str = TEXT) -> Path:
    (folder / "cart.toml").write_text(text)
    return folder / "cart.toml"


def test_with_what_stands_behind_the_name(tmp_path: Path) -> None:
    spec = read(written(tmp_path))
    assert spec.beat == Span(200)
    assert spec.prediction.horizon == 1.0
    assert spec.anomaly.requirement == 0.006
    assert spec.tuning.window == Span(seconds=30.0)
    assert spec.tuning.method == "auto"


def test_with_what_the_environment_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = {"BEAT": "5 s", "SECONDS_AHEAD": "2", "LIMIT": "0.4", "METHOD": "recursive"}
    for name, value in (said | {"GAIN": "0.5"}).items():
        monkeypatch.setenv(name, value)
    spec = read(written(tmp_path))
    assert spec.beat == Span(seconds=5.0)
    assert spec.prediction.horizon == 2.0
    assert spec.anomaly.requirement == 0.0004
    assert spec.tuning.method == "recursive"
    assert spec.model.parameters["gain"].value == 0.5


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (3, TEXT.replace("${BEAT:-200}", "${ABSENT_NAME}")),
        (8, TEXT.replace("${SECONDS_AHEAD:-1}", "${ABSENT_NAME}")),
        (10, TEXT.replace("${LIMIT:-6}", "${ABSENT_NAME}")),
        (12, TEXT.replace("${METHOD:-auto}", "${ABSENT_NAME}")),
    ],
)
def test_a_name_that_is_not_set_is_told_with_its_line(tmp_path: Path, line: int, text: str) -> None:
    told = f"cart.toml:{line}: .*the environment variable ABSENT_NAME is not set: set it, or write"
    with pytest.raises(ConfigError, match=told):
        read(written(tmp_path, text))
