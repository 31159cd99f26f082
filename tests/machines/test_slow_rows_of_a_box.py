"""A box with a quick heater, sampled slowly: many parts of a row are one matrix and a constant."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.machines.thermal import MANY, ThermalBox, _doubled, _part, _parts


@pytest.mark.parametrize("wall", [False, True])
@pytest.mark.parametrize("conductance", [5.0, 60.0, 2000.0])
def test_parts_that_are_doubled_come_to_the_same(wall: bool, conductance: float) -> None:
    box = ThermalBox(wall=wall)
    p = box.parameters.with_values({
        "heater_capacity": 900.0, "heater_conductance": conductance, "box_capacity": 6e4,
    }).values  # fmt: skip
    parts, u = _parts(int(wall), 120.0, p), np.array([0.6, 280.0])
    x = np.append(box.initial(p) + 5.0, np.zeros(3))[: 2 + wall]
    one, many = x.copy(), x.copy()
    _doubled(int(wall), 120.0, u, p, parts, one)
    whole = 1 << (parts - 1).bit_length()
    for _ in range(whole):
        _part(int(wall), 120.0 / whole, u, p, many)
    assert np.allclose(one, many, rtol=1e-11, atol=0.0)
    if parts > MANY:
        assert np.array_equal(box.simulate(x, u[None], np.array([120.0]), p)[0][-1:], one[-1:])
