"""Numbers that hang on a term: what is said is what a fit without the term finds."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.tuning import Problem, moved, solve


def axis(root: float) -> Problem:
    """An axis whose friction has a part that grows with the root of the speed."""
    t = np.arange(4000) * 0.01
    v = np.sin(0.7 * t) * np.sin(0.13 * t)
    a = np.gradient(v, t)
    force = 2.0 * a + 3.0 * v + np.sign(v) * (5.0 + root * np.sqrt(np.abs(v)))
    noise = np.random.default_rng(0).normal(0.0, 0.2, len(t))
    rows = make_block(
        t=(t * 1e9).astype(np.int64), u=np.stack([v, a], axis=1), y=(force + noise)[:, None]
    )
    return Problem(DriveForce("sign+root"), (rows,), ("mass", "Fv", "Fc", "Fr"))


def test_it_is_what_a_fit_without_the_term_finds() -> None:
    problem = axis(root=4.0)
    told = moved(problem, solve(problem), {"root": ("Fr",)})
    without = solve(replace(problem, editable=("mass", "Fv", "Fc")))
    for name in ("Fv", "Fc"):
        reason = told.reasons[told.names.index(name)]
        found = re.fullmatch(r"moves with the form: (\S+) without root", reason)
        assert found and float(found[1]) == pytest.approx(without[name], rel=0.005), reason
    # the mass is told by the acceleration, whatever rubs
    assert told.reasons[told.names.index("mass")] == ""


def test_a_term_that_is_not_there_moves_nothing() -> None:
    problem = axis(root=0.0)
    assert not any(moved(problem, solve(problem), {"root": ("Fr",)}).reasons[:3])
