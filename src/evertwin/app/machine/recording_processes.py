"""Launching the embedded machines: processes of their own, so that no twin can see their truth."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

from evertwin.errors import MissingExtra, ModelError

LIMIT = 600.0
"""Longest time that a world may take [s]."""


class World:
    """An embedded machine that records while others go on; it ends with the block.

    >>> with robot(Path("robot.csv"), "--help") as world:
    ...     world.recordings()
    [PosixPath('robot.csv')]
    """

    def __init__(self, name: str, out: Path, *options: str) -> None:
        self.name, self.out = name, out
        command = [sys.executable, "-m", f"evertwin.worlds.{name}", "--out", str(out), *options]
        self._process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        with self._process:  # waits, and closes its pipe
            self._process.kill()

    def recordings(self) -> list[Path]:
        """What it wrote, once it is done.

        Raises:
            MissingExtra: MuJoCo is not installed.
            ModelError: it failed, or takes too long.
        """
        try:
            _, said = self._process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            raise ModelError(f"the embedded {self.name} takes more than {LIMIT:.0f} s") from None
        if self._process.returncode == 0:
            return sorted(self.out.glob("*.csv")) if self.out.is_dir() else [self.out]
        raise failed(self.name, self._process.returncode, said)


def failed(name: str, code: int, said: str) -> MissingExtra | ModelError:
    """What stopped an embedded machine, from its last words."""
    lacking = re.search(r"No module named '(\w+)", said)
    if lacking is not None:
        extra = "mujoco" if lacking[1] == "mujoco" else "live"
        return MissingExtra.of(lacking[1], extra)
    last = (said.strip().splitlines() or ["no message"])[-1]
    return ModelError(f"the embedded {name} stopped with {code}: {last}")


def robot(out: Path, *options: str) -> World:
    """The mobile robot writes ``out`` (see ``python -m evertwin.worlds.robot --help``)."""
    return World("robot", out, *options)


def shots(out: Path, *options: str) -> World:
    """Pictures into a bag ``out`` (see ``python -m evertwin.worlds.shots --help``)."""
    return World("shots", out, *options)


def arm(out: Path, *options: str) -> World:
    """The arm writes cycles into the folder ``out``."""
    urdf = files("evertwin.machines").joinpath("data", "ur5_like.urdf")
    return World("arm", out, "--urdf", str(urdf), *options)
