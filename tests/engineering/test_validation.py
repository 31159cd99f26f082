"""Validation gives back planted deviations, and says what is left in the residual."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.engineering.held_out import Rules, Run, validate


def run(share: float = 0.04, rows: int = 2000, seed: int = 0, **changes: Any) -> Run:
    """An output whose residual is white and has ``share`` of its rms."""
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(rows, 1))
    r = share * rng.normal(size=(rows, 1))
    given = {"measured": y, "residual": r, "moving": np.ones((rows, 1), bool),
             "u": rng.normal(size=(rows, 2))}  # fmt: skip
    return Run(f"{seed}.csv", **(given | changes))


def rules(**changes: Any) -> Rules:
    return Rules(("q",), ("rad",), ("u1", "u2"), **changes)


@pytest.mark.parametrize(("share", "passed"), [(0.04, True), (0.06, False)])
def test_a_relative_requirement_decides(share: float, passed: bool) -> None:
    report = validate("arm", [run(share)], rules(requirement=0.05))
    assert report.passed is passed
    assert report.together[0].relative_rms == pytest.approx(share, rel=0.05)
    assert ("ok" if passed else "MISSED") in str(report)


def test_an_absolute_requirement_is_in_the_outputs_unit() -> None:
    big = run(0.04, measured=np.full((2000, 1), 1e6))
    assert validate("arm", [big], rules(requirement=0.05, relative=False)).passed
    assert "of 0.05 rad" in str(validate("arm", [big], rules(requirement=0.05, relative=False)))
    assert not validate("arm", [big], rules(requirement=0.03, relative=False)).passed


def test_without_a_requirement_nothing_is_judged() -> None:
    report = validate("arm", [run()], rules())
    assert report.passed is None and report.together[0].passed is None
    assert math.isinf(report.together[0].limit)


def test_moving_rows_are_judged_where_they_are_what_is_asked() -> None:
    still = np.zeros((2000, 1), bool)
    still[:1000] = True
    r = np.where(still, 0.01, 0.2)
    mixed = run(residual=r * np.random.default_rng(1).normal(size=(2000, 1)), moving=still)
    assert validate("arm", [mixed], rules(requirement=0.05, moving=True)).passed
    report = validate("arm", [mixed], rules(requirement=0.05))
    assert not report.passed and report.together[0].moving == 1000


def test_outputs_that_are_not_held_or_not_compared_do_not_decide() -> None:
    both = Run("a.csv", np.ones((50, 2)), np.array([[0.01, 9.0]] * 50), np.ones((50, 2), bool),
               np.zeros((50, 1)))  # fmt: skip
    names = Rules(("a", "b"), ("m", "m"), ("u",), requirement=0.05, held=("a",))
    assert validate("x", [both], names).passed
    out = Rules(("a", "b"), ("m", "m"), ("u",), requirement=0.05, left_out=("b",))
    assert [o.name for o in validate("x", [both], out).together] == ["a"]


def test_a_residual_that_hangs_on_an_input_names_it() -> None:
    rng = np.random.default_rng(0)
    u = rng.normal(size=(2000, 2))
    r = 0.05 * np.sign(u[:, 1:]) + 0.02 * rng.normal(size=(2000, 1))
    found = validate("arm", [run(u=u, residual=r)], rules()).together[0]
    assert found.input == "u2" and found.share > 0.7 and found.white


def test_a_coloured_residual_is_not_white_and_white_noise_is() -> None:
    walk = np.convolve(np.random.default_rng(0).normal(size=2000), np.ones(20) / 20, "same")
    assert not validate("arm", [run(residual=walk[:, None])], rules()).together[0].white
    assert validate("arm", [run()], rules()).together[0].white
    assert validate("arm", [run(residual=walk[:, None])], rules(every=25)).together[0].white


def test_many_runs_are_judged_together_and_each_alone() -> None:
    runs = [run(0.02, seed=1), run(0.08, seed=2)]
    report = validate("arm", runs, rules(requirement=0.05))
    assert [name for name, _ in report.runs] == ["1.csv", "2.csv"]
    assert [found[0].passed for _, found in report.runs] == [True, False]
    expected = math.sqrt((0.02**2 + 0.08**2) / 2)
    assert report.together[0].relative_rms == pytest.approx(expected, rel=0.05)
    content = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert content["schema"] == "evertwin.validation/1" and len(content["runs"]) == 2


def test_no_run_is_said_and_not_passed() -> None:
    report = validate("arm", [], rules(requirement=0.05))
    assert report.passed is None and "no run was given" in str(report)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2000), st.integers(0, 99))
def test_where_a_recording_is_cut_changes_no_deviation(at: int, seed: int) -> None:
    whole = run(0.05, seed=seed)
    parts = [
        Run("part", *(getattr(whole, k)[s] for k in ("measured", "residual", "moving", "u")))
        for s in (slice(None, at), slice(at, None))
    ]
    one = validate("x", [whole], rules()).together[0]
    two = validate("x", parts, rules()).together[0]
    assert two.relative_rms == pytest.approx(one.relative_rms, rel=1e-12)
    assert two.rows == one.rows == 2000


def test_rows_that_are_not_known_do_not_count() -> None:
    r = 0.04 * np.random.default_rng(0).normal(size=(2000, 1))
    r[::2] = np.nan
    found = validate("arm", [run(residual=r)], rules()).together[0]
    assert found.rows == 1000 and found.relative_rms == pytest.approx(0.04, rel=0.1)
