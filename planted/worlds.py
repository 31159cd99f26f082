"""Recordings of the embedded machines, as the demonstration has them written."""

from __future__ import annotations

from pathlib import Path

from evertwin.app.machines import Common, LiveMachine, arm_options, robot_options
from evertwin.app.worlds import arm, robot


def record_robot(out: Path, *options: str) -> None:
    """The mobile robot writes ``out`` and is done."""
    with robot(out, *options) as world:
        world.recordings()


def record_arm(out: Path, *options: str) -> None:
    """The arm writes cycles into the folder ``out`` and is done."""
    with arm(out, *options) as world:
        world.recordings()


def record_live(name: str, out: Path, seconds: float, *orders: str, seed: int = 1) -> list[Path]:
    """What a living machine would say in so many seconds, with orders planned; its files."""
    common = Common(seed=seed, seconds=seconds, record=out, order=list(orders))
    options = {
        "arm": lambda: arm_options(common, "", ""),
        "robot": lambda: robot_options(common, None, topics="command,pose"),
    }[name]()
    with LiveMachine(name, options) as machine:
        machine.wait()
    return [out] if out.exists() else sorted(out.parent.glob(f"{out.stem}-*{out.suffix}"))
