"""Recordings of the embedded machines, as the demonstration has them written."""

from __future__ import annotations

from pathlib import Path

from evertwin.app.worlds import arm, robot


def record_robot(out: Path, *options: str) -> None:
    """The mobile robot writes ``out`` and is done."""
    with robot(out, *options) as world:
        world.recordings()


def record_arm(out: Path, *options: str) -> None:
    """The arm writes cycles into the folder ``out`` and is done."""
    with arm(out, *options) as world:
        world.recordings()
