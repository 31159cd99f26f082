"""Rows side by side: the same torques and switches as row by row, whatever the cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.machines.arm import Arm, lanes
from evertwin.machines.arm.rnea import JOINT
from evertwin.machines.friction.kernel import switch
from planted.arms import row_by_row

ARM = Arm.of("ur5_like", law="tanh")


def rows(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 18)) * 3


@pytest.mark.parametrize("sliding", [False, True])
def test_torques_agree_with_the_recursion_row_by_row(sliding: bool) -> None:
    geometry = ARM.chain.geometry.copy()
    geometry[3 + JOINT * 2 + 12] = float(sliding)
    u = rows(333)
    expected = row_by_row(geometry, ARM.chain.inertia, u)
    np.testing.assert_allclose(lanes.batch(geometry, ARM.chain.inertia, u), expected, atol=1e-11)


def test_cuts_change_no_bit() -> None:
    u, width, still = rows(100), np.array([0.02, 0.5, 0, 0.02, 1, 0]), np.full(6, 0.1)
    whole = lanes.batch(ARM.chain.geometry, ARM.chain.inertia, u)
    places = np.array([0, 1, -1, 3, 4, 5])
    switched = lanes.switches(u, places, width, still)
    for a, b in ((0, 1), (1, 34), (34, 67), (67, 100)):
        part = np.ascontiguousarray(u[a:b])
        assert np.array_equal(lanes.batch(ARM.chain.geometry, ARM.chain.inertia, part), whole[a:b])
        assert np.array_equal(lanes.switches(part, places, width, still), switched[a:b])


def test_switches_agree_with_the_law() -> None:
    u, width, still = rows(200), np.array([0.02, 0.5, 0, 3, 30, 0]), np.full(6, 0.1)
    found = lanes.switches(u, np.arange(6), width, still)
    expected = [[switch(row[6 + j], width[j], still[j]) for j in range(6)] for row in u]
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_sine_and_cosine_over_many_turns() -> None:
    angles = np.random.default_rng(1).uniform(-1e4, 1e4, 5000)
    found = np.array([lanes.sine.plain(angle) for angle in angles])
    np.testing.assert_allclose(found, np.stack([np.sin(angles), np.cos(angles)], 1), atol=1e-15)


def test_compiled_equals_plain_bit_for_bit() -> None:
    u, width, still = rows(40), np.array([0.02, 0.5, 0, 0.02, 1, 0]), np.full(6, 0.1)
    arm = ARM.chain.geometry, ARM.chain.inertia
    assert np.array_equal(lanes.batch.plain(*arm, u), lanes.batch.compiled(*arm, u))
    law = u, np.arange(6), width, still
    plain, compiled = lanes.switches.plain, lanes.switches.compiled
    assert np.array_equal(plain(*law), compiled(*law))


def test_the_regressor_agrees_with_the_kernel() -> None:
    u = rows(50)
    p = ARM.parameters.values + 0.3
    y0, phi = ARM.regressor(np.zeros(0), u, np.zeros(50), p)
    _, y = replace(ARM).simulate(np.zeros(0), u, np.zeros(50), p)
    np.testing.assert_allclose(y0 + (phi * p[ARM.columns]).sum(axis=2), y, atol=1e-10)
