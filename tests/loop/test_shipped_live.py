"""Shipped twin files live: `python -m proofs.live` shows it for every one of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evertwin.fold import Chunk
from evertwin.rows import Data
from evertwin.twin import Twin
from planted.pushed import compared, tank
from planted.robots import drive
from planted.twins import shipped
from planted.worlds import record_robot


def world(folder: Path) -> Data:
    record_robot(
        folder / "robot.csv", "--light", "--world", "w3", "--seconds", "150", "--seed", "1"
    )
    return folder / "robot.csv"


RECORDINGS: dict[str, Callable[[Path], Data]] = {
    "robot1d": world, "template": lambda _: tank(800), "wear": lambda _: drive(1).columns,
}  # fmt: skip


@pytest.mark.parametrize("name", RECORDINGS)
def test_pushed_is_recorded_and_in_time(name: str, tmp_path: Path) -> None:
    found = compared(shipped(name), RECORDINGS[name](tmp_path), np.random.default_rng(1))
    assert found.different == ()
    assert found.late <= found.beat + found.delay
    assert found.entries >= (3 if name == "wear" else 8) and found.pieces > 50


def test_a_run_counts_its_tasks_from_its_first() -> None:
    run, t = drive(1).columns, np.arange(600) * 10**8
    values = np.column_stack([run["v"], run["x"]])
    with Twin(shipped("robot1d")) as twin:
        for task in (4, 7):
            twin.push(Chunk("log", t + task * 10**12, values, task))
        trace = twin.finish().trace
        ran = [e.evidence["tasks"] for e in twin.events if e.kind == "ran"]
    assert np.unique(trace["task"]).tolist() == [0, 3] and ran == [4]
