"""The heated box: laws of a model, its plain-Python twin, its physics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm

from evertwin.machines import thermal
from evertwin.machines.thermal import ThermalBox
from evertwin.models import check_model


def heated(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    heater = np.repeat(rng.integers(0, 2, n // 20 + 1), 20)[:n].astype(float)
    return np.column_stack([heater, np.full(n, 294.0)]), rng.uniform(2.8, 3.2, n)


@pytest.mark.parametrize("wall", [False, True])
def test_the_laws_of_a_model_hold(wall: bool) -> None:
    check_model(ThermalBox(wall=wall), *heated(40))


@pytest.mark.parametrize("wall", [False, True])
def test_compiled_and_plain_step_agree_bit_for_bit(
    wall: bool, run_as: Callable[[str], None]
) -> None:
    run_as("machine code")
    box = ThermalBox(wall=wall)
    p = box.parameters.values
    u, dt = heated(30)
    x = box.initial(p)
    _, compiled = box.simulate(x, u, dt, p)
    context, ahead, y = np.array(box.context), np.zeros_like(x), np.zeros(1)
    for i in range(len(u)):
        assert thermal.step.plain(context, x, u[i], dt[i], p, ahead, y) == 0
        x = ahead.copy()
        assert y[0] == compiled[i, 0]
    thermal.observe.plain(context, x, np.array([np.nan]))
    assert x[1] == ahead[1]
    thermal.observe.plain(context, x, np.array([300.0]))
    assert x[1] == 300.0


def test_it_agrees_with_the_matrix_exponential() -> None:
    box = ThermalBox(wall=True)
    p = box.parameters.values
    _, ch, gh, cb, gb, _, cw, gw, _ = p
    a = np.array(
        [
            [-gh / ch, gh / ch, 0],
            [gh / cb, -(gh + gb + gw) / cb, gw / cb],
            [0, gw / cw, -gw / cw],
        ]
    )
    x = np.array([30.0, 10.0, 5.0])
    end, _ = box.simulate(x + 293.15, np.array([[0.0, 293.15]]), np.array([60.0]), p)
    assert end - 293.15 == pytest.approx(expm(60 * a) @ x, rel=1e-4)


def test_without_heat_everything_comes_to_the_room() -> None:
    box = ThermalBox(wall=True)
    p = box.parameters.values
    end, _ = box.simulate(
        np.array([400.0, 310.0, 320.0]), np.tile([0.0, 290.0], (3000, 1)), np.full(3000, 10.0), p
    )
    assert end == pytest.approx([290.0] * 3, abs=1e-3)


def test_a_step_that_is_too_long_is_an_error_and_no_number() -> None:
    box = ThermalBox()
    p = box.parameters.values
    _, y = box.simulate(box.initial(p), np.array([[0.0, 293.0]]), np.array([1e9]), p)
    assert np.isnan(y).all()


def test_the_starts_belong_to_a_recording() -> None:
    box = ThermalBox(wall=True)
    p = box.parameters.with_values({"heater_start": 350.0, "wall_start": 300.0}).values
    assert box.initial(p).tolist() == [350.0, 300.0, 300.0]
    assert box.initials == ("heater_start", "wall_start")
