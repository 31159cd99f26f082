"""Domain randomisation: laws, statistics, compiled against plain."""

from __future__ import annotations

import types

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.machines.mobile import Differential, Robot1D
from evertwin.models import check_model, noise_kernels
from evertwin.models.corrected import Corrected, Term
from evertwin.models.randomized import Randomized


def test_laws_of_the_contract() -> None:
    inner = Corrected(Differential(), (Term("lag", "*"),))
    model = Randomized(inner, 3, (("gain", 0.1),), (0.01, 0.02), (0.01, 0.01, 0.001))
    check_model(model)
    assert isinstance(Randomized(Robot1D(), 1).observe(np.zeros(2), np.array([1.0])), np.ndarray)


def test_noise_is_normal_and_white() -> None:
    model = Randomized(Robot1D(), 7, output_noise=(2.0,))
    y = model.simulate(np.zeros(2), np.zeros((20000, 1)), np.ones(20000), np.ones(1))[1][:, 0]
    assert abs(y.mean()) < 0.06 and y.std() == pytest.approx(2.0, rel=0.02)
    assert abs(np.corrcoef(y[1:], y[:-1])[0, 1]) < 0.03
    assert np.mean(np.abs(y) > 2 * 1.96) == pytest.approx(0.05, abs=0.008)


def test_parameters_spread_over_seeds_and_outputs_get_input_noise() -> None:
    drawn = [Randomized(Robot1D(), s, (("gain", 0.1),)).factors[0] for s in range(400)]
    assert np.std(drawn) == pytest.approx(0.1, rel=0.15)
    y = Randomized(Robot1D(), 0, input_noise=(0.5,)).simulate(
        np.zeros(2), np.zeros((4000, 1)), np.ones(4000), np.ones(1)
    )[1]
    assert np.diff(y[:, 0]).std() == pytest.approx(0.5, rel=0.05)


def test_compiled_equals_plain() -> None:
    space = dict(vars(noise_kernels))
    for name in ("mixed", "normal", "disturbed"):
        code = getattr(noise_kernels, name).py_func.__code__
        space[name] = types.FunctionType(code, space, name)
    for row in range(50):
        a, b = np.zeros(3), np.zeros(3)
        sigma = np.array([1.0, 0.0, 0.3])
        noise_kernels.disturbed(a, sigma, 5, row, 2)
        with np.errstate(over="ignore"):
            space["disturbed"](b, sigma, 5, row, 2)
        assert np.array_equal(a, b)


def test_misuse() -> None:
    with pytest.raises(UsageError, match="no parameter"):
        Randomized(Robot1D(), 0, (("gian", 0.1),))
    with pytest.raises(UsageError, match="output_noise"):
        Randomized(Robot1D(), 0, output_noise=(0.1, 0.1))
