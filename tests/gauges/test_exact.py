"""A reading is told where its own number is asked for, all the while: no drift, no other number."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.gauges.rows.reading import Reading, readings
from evertwin.gauges.units.misread import PIECES
from evertwin.machines.mobile import Differential
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.types import Vector

ROWS, SEEDS = 300, range(100)
MAP = FunctionModel(
    lambda x, u, dt, p: ([], [p[0] * u[0]]),
    Layout.of(load="kg"), Layout.of(power="W"), parameters=Parameters.of(k=(2.0, "W/kg")),
)  # fmt: skip


def pounds() -> Reading:
    said = "load looks 2.205 times what it is"
    return next(one for one in readings(MAP, ("kg", "W")) if said in one.said)


def exact(seed: int, number: Callable[[Vector], Vector]) -> bool:
    """Is it pounds, where the load counts ``number`` times, by how far the rows have gone?"""
    rng = np.random.default_rng(seed)
    load = rng.uniform(50.0, 400.0, ROWS)
    power = 2.0 * load + rng.normal(0.0, 8.0, ROWS)
    u = (number(np.linspace(0.0, 1.0, ROWS)) * load)[:, None]
    block = make_block(t=np.arange(ROWS), u=u, y=power[:, None])

    def off(one: Reading) -> Vector:
        left = np.square(one.undone(block).y - 2.0 * one.undone(block).u)
        return np.array([part.sum() for part in np.array_split(left, PIECES)])

    return pounds().exact(off)


def test_a_unit_is_told() -> None:
    assert all(exact(seed, lambda at: np.full(len(at), 2.20462)) for seed in SEEDS)


@pytest.mark.parametrize("size", [1.6, 1.9, 2.6, 3.2])
def test_another_number_is_no_unit(size: float) -> None:
    assert not any(exact(seed, lambda at: np.full(len(at), size)) for seed in SEEDS)


@pytest.mark.parametrize("end", [2.2, 2.8, 3.4])
def test_what_grows_slowly_is_no_unit(end: float) -> None:
    assert not any(exact(seed, lambda at: 1.0 + (end - 1.0) * at) for seed in SEEDS)


def test_all_or_nothing_of_a_reading_is_it_or_what_was_recorded() -> None:
    values = np.random.default_rng(0).normal(size=(5, 5))
    for one in readings(Differential(), ("",) * 5):
        np.testing.assert_allclose(one.partly(1.0).of(values), one.of(values), atol=1e-9)
        np.testing.assert_allclose(one.partly(0.0).of(values), values, atol=1e-9)
