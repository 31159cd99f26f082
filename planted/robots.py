"""A robot on a line, with planted faults of its sensor, and the twin of `twins/robot1d.toml`.

10 Hz, position noise σ = 1 cm. Ways to drive from the origin: on at 0.158 ± 0.05 m/s; to and fro,
0.3 m/s · sin(2π·t/20 s); stop and go, 0.25 m/s for 3 s, then 2 s at rest; random speeds within
± 0.3 m/s, each held 2 to 6 s.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin import RunResult
from evertwin.models.spec import ParameterSpec
from planted.twins import opened

RATE, ROWS, SIGMA = 10.0, 600, 0.01
WAYS = ("driving on", "to and fro", "stop and go", "random speeds")


class Run(NamedTuple):
    """One recording with its fault."""

    v: np.ndarray
    """Commanded speed over the interval into each row [m/s]."""
    y: np.ndarray
    """Measured position [m]."""
    truth: np.ndarray
    faulty: np.ndarray

    @property
    def columns(self) -> Mapping[str, np.ndarray]:
        """As it is recorded: a command holds from its stamp on."""
        t = np.arange(len(self.y)) / RATE
        return {"t": t, "v": np.r_[self.v[1:], self.v[-1:]], "x": self.y}


def speeds(rng: np.random.Generator, rows: int, way: str) -> np.ndarray:
    """Commanded speed [m/s]."""
    seconds, phase = np.arange(rows) / RATE, rng.uniform(0, 6)
    if way == "driving on":
        return np.asarray(0.158 + 0.05 * np.sin(0.5 * seconds + phase))
    if way == "to and fro":
        return np.asarray(0.3 * np.sin(2 * np.pi * seconds / 20 + phase))
    if way == "stop and go":
        return np.where((seconds + phase) % 5 < 3, 0.25, 0.0)
    v, k = np.empty(rows), 0
    while k < rows:
        hold = int(rng.integers(2 * RATE, 6 * RATE + 1))
        v[k : k + hold] = rng.uniform(-0.3, 0.3)
        k += hold
    return v


def drive(seed: int, rows: int = ROWS, way: str = WAYS[0]) -> Run:
    """A recording without fault."""
    rng = np.random.default_rng(seed)
    v = speeds(rng, rows, way)
    truth = np.concatenate([[0.0], np.cumsum(v[1:] / RATE)])
    y = truth + rng.normal(0, SIGMA, rows)
    return Run(v, y, truth, np.zeros(rows, dtype=np.bool_))


def followed(run: Run, sigma: float = SIGMA, gain: float = 1.05, **sections: Any) -> RunResult:
    """The twin beside it, its gain off by 5 %; trusted samples are blended, nothing is tuned."""
    settings = {
        "arbiter": {"use": "blend", "sigma": sigma},
        "model": {"parameters": {"gain": ParameterSpec(value=gain)}},
        "anomaly": {"requirement": np.inf},
    }
    with opened("robot1d", **(settings | sections)) as twin:
        return twin.run(run.columns)


def recordings(folder: Path, world: str, runs: int, seconds: int, sweep: int = 5) -> list[str]:
    """Recordings of one of the embedded worlds, written by the robot's process.

    Args:
        sweep: seconds at each speed before ``seconds`` of random commands.
    """
    command = [
        sys.executable, "-m", "evertwin.worlds.robot", "--light", "--world", world, "--runs",
        str(runs), "--seconds", str(seconds), "--each", str(sweep), "--format", "csv", "--out",
        str(folder / world),
    ]  # fmt: skip
    subprocess.run(command, check=True)
    return [str(path) for path in sorted((folder / world).glob("*.csv"))]
