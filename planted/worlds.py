"""Recordings of the embedded machines, as the demonstration has them written."""

from __future__ import annotations

from pathlib import Path

from evertwin.app.machine.live_processes import Common, LiveMachine, arm_options, robot_options
from evertwin.app.machine.recording_processes import arm, robot
from planted.twins import TWINS


def record_robot(out: Path, *options: str) -> None:
    """The mobile robot writes ``out`` and is done."""
    with robot(out, *options) as world:
        world.recordings()


def record_arm(out: Path, *options: str) -> None:
    """The arm writes cycles into the folder ``out`` and is done."""
    with arm(out, *options) as world:
        world.recordings()


def told_its_pose(site: Path) -> Path:
    """The site of the demonstration, with a robot whose pose somebody else says: of what its store
    has every number can be exported as a table."""
    text = site.read_text()
    site.write_text(text.replace('"scan"', '"pose"').replace("robot/scan", "robot/pose"))
    twin = (TWINS / "robot_pose.toml").read_text().replace('"robot_pose"', '"robot_live"')
    (site.parent.parent / "twins" / "robot_live.toml").write_text(twin)
    return site


def record_live(
    name: str, out: Path, seconds: float, *orders: str, seed: int = 1, topics: str = "command,scan"
) -> list[Path]:
    """What a living machine would say in so many seconds, with orders planned; its files.
    ``topics``: of the robot."""
    common = Common(seed=seed, seconds=seconds, record=out, order=list(orders))
    options = {
        "arm": lambda: arm_options(common, "", ""),
        "robot": lambda: robot_options(common, None, topics=topics),
    }[name]()
    with LiveMachine(name, options) as machine:
        machine.wait()
    return [out] if out.exists() else sorted(out.parent.glob(f"{out.stem}-*{out.suffix}"))
