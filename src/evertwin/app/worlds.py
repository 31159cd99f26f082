"""Launching the embedded machines: processes of their own, so that no twin can see their truth."""

from __future__ import annotations

import subprocess
import sys
from importlib.resources import as_file, files
from pathlib import Path

from evertwin.errors import MissingExtra, ModelError

LIMIT = 600.0
"""Longest time that a world may take [s]."""


def record_robot(out: Path, *options: str) -> None:
    """The mobile robot writes ``out`` (see ``python -m evertwin.worlds.robot --help``)."""
    _launch("robot", "--out", str(out), *options)


def record_arm(out: Path, *options: str) -> None:
    """The arm writes cycles into the folder ``out``."""
    urdf = files("evertwin.machines").joinpath("data", "ur5_like.urdf")
    with as_file(urdf) as path:
        _launch("arm", "--urdf", str(path), "--out", str(out), *options)


def _launch(world: str, *options: str) -> None:
    command = [sys.executable, "-m", f"evertwin.worlds.{world}", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    if done.returncode == 0:
        return
    if "No module named 'mujoco'" in done.stderr:
        raise MissingExtra.of("mujoco", "mujoco")
    last = (done.stderr.strip().splitlines() or ["no message"])[-1]
    raise ModelError(f"the embedded {world} stopped with {done.returncode}: {last}")
