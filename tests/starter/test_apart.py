"""What files, topics and namespaces are called after says nothing of a single column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.machines.catalog import machine
from evertwin.starter import kind_of, look, mapped
from evertwin.starter.looks.apart import bare, themes

WORDS = (
    "diff", "set", "target", "error", "acc", "ref", "real", "max", "goal", "temp", "force",
    "left_motor",
)  # fmt: skip
FED = {"v": "linear", "w": "angular", "x": "position", "y": "position", "heading": "yaw"}


def _base(seed: int, n: int = 300) -> tuple[np.ndarray, ...]:
    r = np.random.default_rng(seed)
    t = 0.1 * np.arange(n)
    v, w = (np.repeat(r.uniform(a, b, n // 20), 20) for a, b in ((0.1, 0.6), (-0.6, 0.6)))
    heading = np.cumsum(0.1 * w)
    x, y = np.cumsum(0.1 * v * np.cos(heading)), np.cumsum(0.1 * v * np.sin(heading))
    return t, v, w, x, y, np.sin(heading / 2), np.cos(heading / 2)


def _csv(path: Path, names: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.9g")
    return path


def _fed(files: list[Path]) -> dict[str, str]:
    seen, _ = look(files)
    assert kind_of(seen) == "differential"
    found = mapped(machine("differential", {}), seen)
    assert not found.questions
    return {match.channel: match.column for match in found.matches}


@pytest.mark.parametrize("word", WORDS)
def test_two_files_of_one_run(word: str, tmp_path: Path) -> None:
    t, v, w, x, y, sin, cos = _base(1)
    told = _csv(tmp_path / f"{word}3_cmd_vel.csv", "time,linear.x,angular.z", t, v, w)
    pose = _csv(
        tmp_path / f"{word}3_pose.csv",
        "time,pose.position.x,pose.position.y,pose.orientation.x,pose.orientation.y,"
        "pose.orientation.z,pose.orientation.w",
        t, x, y, 0 * t, 0 * t, sin, cos,
    )  # fmt: skip
    assert all(FED[channel] in column for channel, column in _fed([told, pose]).items())


@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("sign", "/.")
def test_a_namespace_of_told_and_measured(word: str, sign: str, tmp_path: Path) -> None:
    t, v, w, x, y, sin, cos = _base(2)
    names = [
        "cmd_vel/linear/x",
        "cmd_vel/angular/z",
        "odom/pose/position/x",
        "odom/pose/position/y",
        "odom/pose/orientation/x",
        "odom/pose/orientation/y",
        "odom/pose/orientation/z",
        "odom/pose/orientation/w",
    ]
    named = ",".join(f"/{word}_controller/{name}".replace("/", sign) for name in names)
    file = _csv(tmp_path / "log.csv", f"__time,{named}", t, v, w, x, y, 0 * t, 0 * t, sin, cos)
    assert all(FED[channel] in column for channel, column in _fed([file]).items())


def test_what_is_an_error_or_a_plan_stays_one() -> None:
    planned = ["target/x", "target/y", "target/v"]
    assert list(bare(planned).values()) == planned, "nothing below it is measured"
    assert themes(["pose", "cmd_vel"]) != ["", ""]
    part = ["cmd_vel/x", "tracking_error/x", "tracking_error/y"]
    assert list(bare(part).values()) == part
    assert list(bare(["speed.set", "speed.act"]).values()) == ["speed.set", "speed.act"]


def test_names_stay_apart() -> None:
    names = ["diff/cmd/x", "diff/odom/x", "cmd/x"]
    assert list(bare(names).values()) == names
