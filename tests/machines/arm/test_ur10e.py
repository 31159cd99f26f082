"""The real arm: figures that hold on runs which the model has not seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.fold import Block, make_block
from evertwin.machines.arm import Arm
from evertwin.signals.fir import Symmetric
from evertwin.tuning import Problem, solve

CONSTANT = np.array([14.87, 13.26, 11.13, 10.62, 11.03, 11.47])
SMOOTH = Symmetric.butterworth(cutoff=5.0, rate=100.0).smooth
PAIR = ("20_02_10-30sec_12harm", "20_02_12-50sec_12harm")
REFERENCE = {
    "20_02_19_14harm50sec": (10.5, 4.5, 4.3, 11.3, 17.1, 12.7),
    "20_02_12-40sec_12harm": (10.1, 4.2, 4.8, 8.7, 12.8, 12.8),
}
Load = Callable[[str], Block]


@pytest.fixture(scope="module")
def folder(data_set: Callable[[str], Path]) -> Path:
    return data_set("ur10e")


@pytest.fixture(scope="module")
def run(folder: Path) -> Load:
    """A recording at 100 Hz, cropped to its motion."""

    def rows(name: str) -> Block:
        kind = "load_pair" if "load" in name else "identification"
        table = np.genfromtxt(folder / kind / f"ur-{name}.csv", delimiter=",", usecols=range(19))
        t = table[:, 0] - table[0, 0]
        grid = np.arange(0.0, t[-1], 0.01)
        q, v, current = (
            np.stack([np.interp(grid, t, column) for column in table[:, a : a + 6].T], axis=1)
            for a in (1, 7, 13)
        )
        moves = np.flatnonzero(np.abs(v).max(axis=1) > 0.02)
        keep = slice(moves[0] + 30, moves[-1] - 30)
        u = np.concatenate([q, v, np.gradient(v, 0.01, axis=0)], axis=1)
        stamps = np.rint(grid * 1e9).astype(np.int64)
        return make_block(t=stamps[keep], u=u[keep], y=(current * CONSTANT)[keep])

    return rows


def arm_of(folder: Path, law: Any) -> Arm:
    return Arm.of(folder / "ur10e.urdf", law=law, base=True, payload=True)


def problem(arm: Arm, *blocks: Block, names: tuple[str, ...] = ()) -> Problem:
    own = tuple(n for n in arm.parameters.editable if not n.startswith("payload"))
    return Problem(
        arm, blocks, names or own, filter=SMOOTH, moving=arm.moving(0.05), only_moving=True
    )


def deviation(arm: Arm, p: np.ndarray, block: Block, moving: bool) -> np.ndarray:
    predicted = arm.simulate(np.zeros(0), block.u, block.dt, p)[1]
    y, r = SMOOTH(block.y), SMOOTH(block.y - predicted)
    counts = np.abs(block.u[:, 6:12]) > (0.05 if moving else -1.0)
    return np.asarray(100 * np.sqrt((r**2 * counts).sum(axis=0) / (y**2 * counts).sum(axis=0)))


@pytest.mark.data
def test_the_sign_law_is_at_least_as_good_as_the_reference(folder: Path, run: Load) -> None:
    arm = arm_of(folder, "sign")
    fit = solve(problem(arm, *map(run, PAIR)))
    for name, reference in REFERENCE.items():
        found = deviation(arm, fit.p, run(name), moving=False)
        assert (found <= reference).all(), (name, found.round(1))


@pytest.mark.data
def test_a_load_is_weighed_and_its_absence_too(folder: Path, run: Load) -> None:
    laws = ["tanh+root", *["tanh+root+load"] * 2, "tanh", "tanh+root", "tanh"]
    arm = arm_of(folder, laws)
    trained = solve(problem(arm, *map(run, PAIR)))
    known = replace(arm, parameters=arm.parameters.with_values(trained.p))
    last = deviation(known, trained.p, run("20_02_19_14harm50sec"), moving=True)
    assert (last <= [6, 4, 4, 6, 6, 6]).all(), last.round(2)
    names = ("payload.m", "payload.mx", "payload.my", "payload.mz")
    for name, mass in (("20_01_31-load", 3.05), ("20_01_31-unload", 0.0)):
        fit = solve(problem(known, run(name), names=names))
        assert fit["payload.m"] == pytest.approx(mass, abs=0.2), name
