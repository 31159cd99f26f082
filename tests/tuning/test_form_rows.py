"""What a shape explains, reckoned without a copy of each."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.tuning.form.form_error import _apart, _best, _gains, _products
from evertwin.tuning.form.form_rows import Asked, Shaped


@pytest.mark.parametrize("seed", range(5))
def test_it_is_what_the_columns_themselves_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, columns = rng.normal(size=400), rng.normal(size=(400, 7)) * 10.0 ** rng.integers(-3, 4, 7)
    columns[:, 3] = 0.0
    columns[:, 4] = columns[:, 5] * u / np.quantile(np.abs(u), 0.99)  # a shape of another column
    one = Asked(columns, np.arange(7), rng.normal(size=400), {"u": Shaped(u)})
    basis = one.basis
    terms, whole = one.candidates()
    left, r = _apart(one, basis, whole)
    gains, length = _gains(left, r)
    assert len(terms) == len(gains) and (length < 1e-4).any()
    found = _best(one, one.inputs["u"], _products(basis, columns), r)
    assert found == pytest.approx(gains.max(), rel=1e-9)
    assert _best(one, Shaped(np.zeros(400)), _products(basis, columns), r) == 0.0
