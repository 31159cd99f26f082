"""The one-axis drive: two forms of one machine, standstill, and the offset trap's regressor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.machines import drive
from evertwin.machines.drive import Drive, DriveForce
from evertwin.models import check_model

LAWS = ["sign", "tanh", "sign+direction", "tanh+direction+stribeck+root"]
TRUTH = {"mass": 95.0, "Fv": 200.0, "Fv_plus": 165.0, "Fv_minus": 240.0, "Fc": 20.0,
         "offset": -3.0, "Fs": 5.0, "Fr": 2.0, "Fc_minus": 4.0}  # fmt: skip


def planted(model: Drive | DriveForce) -> np.ndarray:
    names = model.parameters.names
    values = {name: value for name, value in TRUTH.items() if name in names}
    return model.parameters.with_values(values).values


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize("law", LAWS)
def test_the_laws_of_a_model_hold(law: str, two_sided: bool) -> None:
    for rotary in (False, True):
        check_model(Drive(law, two_sided, rotary))
        check_model(DriveForce(law, two_sided, rotary=rotary))


@pytest.mark.parametrize("law", LAWS)
def test_compiled_and_plain_step_agree_bit_for_bit(law: str, run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    rng = np.random.default_rng(1)
    for model, step in (
        (Drive(law, True), drive.step),
        (DriveForce(law, True), drive.force_step),
    ):
        p, x = planted(model), np.zeros(len(model.states))
        u = rng.uniform(-60, 60, (50, len(model.inputs)))
        dt = rng.uniform(0.001, 0.02, 50)
        _, compiled = model.simulate(x, u, dt, p)
        context, ahead, y = np.array(model.context), x.copy(), np.zeros(len(model.outputs))
        for i in range(50):
            assert step.plain(context, x, u[i], dt[i], p, ahead, y) == 0
            x = ahead.copy()
            assert y.tolist() == compiled[i].tolist()


def test_observing_adopts_what_was_measured(run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    x = np.array([1.0, 2.0])
    drive.observe.plain(np.zeros(1), x, np.array([5.0, np.nan]))
    assert x.tolist() == [5.0, 2.0]
    assert drive.force_observe.plain(np.zeros(1), x, x) == 0


@pytest.mark.parametrize("law", LAWS)
def test_both_forms_are_one_machine(law: str) -> None:
    forward, backward = Drive(law), DriveForce(law)
    assert forward.parameters == backward.parameters
    p, dt = planted(forward), 1e-4
    t = np.arange(20000) * dt
    u = 60 * np.sin(2 * np.pi * t)[:, None] + 40
    _, y = forward.simulate(np.zeros(2), u, np.full(len(t), dt), p)
    v = 0.5 * (y[1:, 1] + y[:-1, 1])
    a = np.diff(y[:, 1]) / dt
    moving = np.abs(v) > 0.02
    _, f = backward.simulate(
        np.zeros(0), np.column_stack([v, a])[moving], np.full(moving.sum(), dt), p
    )
    assert f[:, 0] == pytest.approx(u[1:, 0][moving], abs=0.3)


def test_a_drive_stays_at_rest_within_its_friction() -> None:
    model = Drive("sign", two_sided=True)
    p = model.parameters.with_values({"Fc": 20.0, "Fc_minus": 10.0, "offset": 5.0}).values
    for pull, moves in ((24.9, 0), (25.1, 1), (-24.9, 0), (-25.1, -1)):
        _, y = model.simulate(np.zeros(2), np.array([[pull]]), np.array([0.01]), p)
        assert np.sign(y[0, 1]) == moves, pull


def test_a_drive_that_slides_comes_to_rest_and_does_not_turn_back() -> None:
    model = Drive()
    p = planted(model)
    _, y = model.simulate(np.array([0.0, 0.1]), np.full((2000, 1), -3.0), np.full(2000, 1e-3), p)
    assert (np.diff(y[:, 0]) >= 0).all()
    assert y[-1, 1] == 0.0


def test_the_closed_form_finds_planted_truth() -> None:
    model = DriveForce("sign+direction")
    p = planted(model)
    rng = np.random.default_rng(2)
    u = np.column_stack([rng.uniform(-0.15, 0.15, 2000), rng.uniform(-2, 2, 2000)])
    _, y = model.simulate(np.zeros(0), u, np.full(2000, 1e-3), p)
    y0, phi = model.regressor(np.zeros(0), u, np.full(2000, 1e-3), p)
    found = np.linalg.lstsq(phi[:, 0], (y - y0)[:, 0], rcond=None)[0]
    assert found == pytest.approx(p[model.columns[0]], rel=1e-9)


def test_an_offset_with_two_sided_coulomb_friction_has_no_rank_while_moving() -> None:
    rng = np.random.default_rng(3)
    u = np.column_stack([rng.uniform(-0.15, 0.15, 4000), rng.uniform(-2, 2, 4000)])
    moving = u[np.abs(u[:, 0]) > 0.01]
    for two_sided, rank in ((False, 5), (True, 5)):
        model = DriveForce("sign+direction", two_sided)
        _, phi = model.regressor(np.zeros(0), moving, np.ones(len(moving)), model.parameters.values)
        assert np.linalg.matrix_rank(phi[:, 0]) == rank
        assert phi.shape[2] == rank + two_sided


def test_a_drive_has_no_load_torque() -> None:
    with pytest.raises(UsageError, match="load"):
        Drive("sign+load")


def test_a_step_that_is_too_long_is_an_error_and_no_number() -> None:
    model = Drive()
    _, y = model.simulate(np.zeros(2), np.ones((1, 1)), np.array([1e6]), planted(model))
    assert np.isnan(y).all()
