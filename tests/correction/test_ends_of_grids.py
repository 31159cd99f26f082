"""A grid whose numbers would lie beyond their ends is none: no machine does that to its input."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.correction.search.improve import Selection, improve
from evertwin.fold import make_block
from evertwin.machines.mobile import Robot1D
from evertwin.machines.thermal import ThermalBox
from evertwin.models.form import Form
from evertwin.models.terms.rows import Rows


@pytest.mark.parametrize(("times", "found"), [(2.0, True), (20.0, False)])
def test_a_table_reaches_three_times_what_was_commanded(times: float, found: bool) -> None:
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([0.05, 0.1, 0.2], 60), 5)
    y = times * u.cumsum() + 1e-3 * rng.normal(size=300)
    rows = make_block(t=np.arange(300) * 10**9, u=u[:, None], y=y[:, None])
    assert improve(Robot1D(), Form(), (rows,), 5.0, Selection(kinds=("table",))).found == found


def test_a_temperature_is_as_large_as_its_range() -> None:
    model, n = ThermalBox(), 50
    u = np.column_stack([np.full(n, 0.5), np.linspace(293.0, 295.0, n)])
    assert model.inputs.names == ("heater", "room")
    rows = make_block(t=np.arange(n) * 10**9, u=u, y=np.full((n, 1), 300.0))
    seen = Rows(model, (rows,), (), 5.0)
    assert seen.size("room") == pytest.approx(2.0) and seen.size("heater") == 0.5
