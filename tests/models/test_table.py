"""A table of measured data as a model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from evertwin.errors import DataError, UsageError
from evertwin.fold import make_block
from evertwin.machines.catalog import machine
from evertwin.models import check_model
from evertwin.models.tables.table import TableModel
from evertwin.tuning import Problem, solve

SPEED, TORQUE = [0.0, 50.0, 120.0, 200.0], [-2.0, 0.0, 3.0]


def surface(seed: int = 0, beyond: str = "hold") -> tuple[TableModel, np.ndarray]:
    z = np.random.default_rng(seed).normal(size=(4, 3, 2))
    a, b = np.meshgrid(SPEED, TORQUE, indexing="ij")
    order = np.random.default_rng(1).permutation(12)
    model = TableModel.of(
        {"speed": a.ravel()[order], "torque": b.ravel()[order]},
        {"loss": z[..., 0].ravel()[order], "heat": z[..., 1].ravel()[order]},
        {"speed": "rad/s", "torque": "Nm", "loss": "W", "heat": "W"}, beyond,
    )  # fmt: skip
    return model, z


def test_it_keeps_the_laws() -> None:
    check_model(surface()[0])


@given(st.floats(0, 200), st.floats(-2, 3))
def test_inside_it_is_the_interpolation_of_its_corners(speed: float, torque: float) -> None:
    model, z = surface()
    expected = RegularGridInterpolator((SPEED, TORQUE), z)([[speed, torque]])
    np.testing.assert_allclose(model.look_up(np.array([[speed, torque]])), expected, atol=1e-9)


def test_outside_is_as_chosen_and_is_said() -> None:
    rows = np.array([[300.0, 0.0], [100.0, 0.0], [-1.0, 9.0]])
    hold, line, error = (surface(0, way)[0] for way in ("hold", "line", "error"))
    edge = hold.look_up(np.array([[200.0, 0.0]]))
    np.testing.assert_allclose(hold.look_up(rows[:1]), edge)
    before = line.look_up(np.array([[120.0, 0.0]]))
    np.testing.assert_allclose(line.look_up(rows[:1]), edge + (edge - before) * 100 / 80)
    assert np.isnan(error.look_up(rows)).all(axis=1).tolist() == [True, False, True]
    assert hold.outside(rows) == {"speed": 2, "torque": 1}
    assert hold.notes == (
        "measured for speed from 0 to 200 rad/s, torque from -2 to 3 Nm; outside the edge is held",
    )


def test_gain_and_offset_are_solved_for_at_once() -> None:
    model, _ = surface()
    rng = np.random.default_rng(2)
    u = np.column_stack([rng.uniform(0, 200, 400), rng.uniform(-2, 3, 400)])
    truth = model.parameters.with_values({"gain.loss": 1.3, "offset.heat": -0.4}).values
    _, y = model.simulate(np.zeros(0), u, np.ones(400), truth)
    y += rng.normal(0, 0.05, y.shape)
    fit = solve(Problem(model, (make_block(t=np.arange(400), u=u, y=y),)))
    assert fit.method == "closed form"
    np.testing.assert_allclose(fit.values, truth, atol=0.02)
    assert (np.abs(fit.values - truth) < 3.5 * fit.sigma).all()


def test_repeated_rows_are_averaged_and_unknown_ones_left_out() -> None:
    model = TableModel.of({"a": [0, 1, 1, np.nan]}, {"b": [0, 2, 4, 9]})
    assert model.values.ravel().tolist() == [0.0, 3.0]


def test_a_table_is_read_from_a_file_in_its_units(tmp_path: Path) -> None:
    file = tmp_path / "pump.csv"
    file.write_text("rpm,bar,flow\n0,1,0\n0,2,0\n3000,1,60\n3000,2,30\n")
    given = {"rpm": "rpm", "bar": "bar"}
    pump = machine("table", {"file": str(file), "inputs": given, "outputs": {"flow": "l/min"}})
    check_model(pump)
    half = np.array([[1500 * 2 * np.pi / 60, 1.5e5]])
    _, y = pump.simulate(np.zeros(0), half, np.ones(1), pump.parameters.values)
    assert y[0, 0] * 60_000 == pytest.approx(22.5)


def test_what_is_no_table_is_told(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"grid of 2 x 2.*first: a = 1, b = 0"):
        TableModel.of({"a": [0, 0, 1], "b": [0, 1, 1]}, {"c": [1, 2, 3]})
    with pytest.raises(DataError, match="a: expected at least two values"):
        TableModel.of({"a": [1, 1]}, {"c": [1, 2]})
    with pytest.raises(DataError, match="one length"):
        TableModel.of({"a": [1, 2, 3]}, {"c": [1, 2]})
    with pytest.raises(UsageError, match="hold, line or error"):
        TableModel.of({"a": [1, 2]}, {"c": [1, 2]}, beyond="guess")
    with pytest.raises(UsageError, match="at least one input"):
        TableModel.of({}, {"c": [1, 2]})
    file = tmp_path / "pump.csv"
    file.write_text("rpm,flow\n0,0\n0,1\n")
    with pytest.raises(DataError, match=r"pump\.csv: table: rpm: expected at least two"):
        machine("table", {"file": str(file), "inputs": ["rpm"], "outputs": ["flow"]})
    with pytest.raises(DataError, match="no column 'rmp'"):
        machine("table", {"file": str(file), "inputs": ["rmp"], "outputs": ["flow"]})
    with pytest.raises(UsageError, match="got a text"):
        machine("table", {"file": str(file), "inputs": "rpm", "outputs": ["flow"]})
