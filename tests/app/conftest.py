"""A small twin on disk, and the command line in this process or in one of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.app.cli import main

TWIN = """schema = 1
name = "robot"
beat = 10

[model]
kind = "robot1d"

[[source]]
name = "log"
time = { column = "t", unit = "s" }

[source.channels]
v = { column = "v", unit = "cm/s" }
x = { column = "x", unit = "cm" }

[arbiter]
use = "tolerance"
tolerance = "3 cm"

[prediction]
horizon = "1 s"

[anomaly]
requirement = "0.5 cm"
window = 100

[tuning]
window = 600

[store]
path = "robot.db"
"""


@dataclass(frozen=True)
class Done:
    """What a command gave."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        assert self.out, self.err
        return json.loads(self.out)


Command = Callable[..., Done]


def columns(rows: int = 1200, gain: float = 0.9, seed: int = 1) -> dict[str, np.ndarray]:
    """A robot on a line at 10 Hz whose gain is not 1, measured with 1 mm of noise [cm]."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(rows)
    v = 10.0 * np.sign(np.sin(0.4 * t)) + 5.0 * np.sin(1.3 * t)
    x = np.concatenate([[0.0], np.cumsum(0.1 * gain * v[:-1])])
    return {"t": t, "v": v, "x": x + rng.normal(0.0, 0.1, rows)}


def save(path: Path, table: dict[str, np.ndarray]) -> Path:
    rows = zip(*table.values(), strict=True)
    lines = [",".join(table), *(",".join(f"{cell:.9g}" for cell in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A twin file and its recording."""
    (tmp_path / "robot.toml").write_text(TWIN)
    save(tmp_path / "robot.csv", columns())
    return tmp_path


@pytest.fixture
def call(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Command:
    """``call("run", "robot.toml")`` in the folder, in this process."""
    monkeypatch.chdir(folder)

    def run(*words: str) -> Done:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main(list(words))
        seen = capsys.readouterr()
        return Done(int(ended.value.code or 0), seen.out, seen.err)

    return run


@pytest.fixture
def spawn(folder: Path) -> Command:
    """The same in a process of its own: exit codes as a shell sees them."""

    def run(*words: str) -> Done:
        done = subprocess.run(
            [sys.executable, "-m", "evertwin", *words], cwd=folder, capture_output=True,
            text=True, timeout=120, check=False,
        )  # fmt: skip
        return Done(done.returncode, done.stdout, done.stderr)

    return run
