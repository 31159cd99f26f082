"""Intervals that carry the error of the form, on axes with an effect that the law lacks."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.tuning import Fit, Problem, carried, solve
from planted.axes import EFFECTS, Axis, drawn


def problem(axis: Axis) -> Problem:
    columns = axis.columns
    u = np.stack([columns["speed"], columns["acceleration"]], axis=1)
    t = np.round(columns["t"] * 1e9).astype(np.int64)
    rows = make_block(t=t, u=u, y=columns["force"][:, None])
    return Problem(
        DriveForce(), (rows,), moving=lambda v: np.abs(v[:, :1]) > 0.005 * axis.top,
        only_moving=True,
    )  # fmt: skip


def told(axis: Axis) -> tuple[Fit, Fit]:
    posed = problem(axis)
    fit = solve(posed)
    return fit, carried(posed, fit)


def test_a_right_form_keeps_its_intervals() -> None:
    for seed in range(3):
        before, after = told(drawn("plain", seed))
        assert after is before


@pytest.mark.parametrize("effect", ["film", "drag", "one_way", "bent"])
def test_a_wrong_form_widens_or_moves_what_it_misleads(effect: str) -> None:
    held = {"before": 0, "after": 0}
    for seed in range(4):
        axis = drawn(effect, seed)
        for when, fit in zip(held, told(axis), strict=True):
            ends = [(fit.interval(name), truth) for name, truth in axis.truth.items()]
            held[when] += sum(low <= truth <= high for (low, high), truth in ends)
    assert held["after"] > held["before"]
    assert held["after"] >= 0.85 * 4 * len(drawn(effect, 0).truth)


def test_values_stay_and_what_they_only_make_up_for_is_said() -> None:
    before, after = told(drawn("drag", 1))
    np.testing.assert_array_equal(before.values, after.values)
    np.testing.assert_array_equal(before.covariance, after.covariance)
    assert before.verdict[before.names.index("Fc")] == "identifiable"
    (low, high), where = after.interval("Fc"), after.names.index("Fc")
    alone = before.interval("Fc")
    assert low <= alone[0] < after["Fc"] < alone[1] <= high  # as it is found here, and left free
    assert high - low > 1.5 * (alone[1] - alone[0])
    assert after.verdict[where] == "weak"
    assert "the form of force does not hold (" in after.reasons[where]
    assert "only predicts best" in after.reasons[where]
    assert f"{low:.4g} to {high:.4g}" in str(after)


def test_every_effect_is_reproducible_and_in_the_truth() -> None:
    for effect in EFFECTS:
        one, again = drawn(effect, 5), drawn(effect, 5)
        np.testing.assert_array_equal(one.columns["force"], again.columns["force"])
        assert set(one.truth) == set(one.own) and all(half > 0 for half in one.own.values())
