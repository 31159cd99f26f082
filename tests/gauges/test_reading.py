"""What is derived is read otherwise with what it is derived from, and never alone."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.gauges.rows.reading import Reading, possible
from evertwin.models import FunctionModel, Parameters
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.sync.spec import DeriveSpec

ARM = FunctionModel(
    lambda x, u, dt, p: ([], [p[0] * u[2] + u[0], p[0] * u[3] + u[1]]),
    Layout.of(q1="rad", q2="rad", qd1="rad/s", qd2="rad/s"), Layout.of(tau1="Nm", tau2="Nm"),
    parameters=Parameters.of(k=(2.0, "Nms/rad")),
)  # fmt: skip
SPEEDS = tuple(DeriveSpec(name=f"qd{k}", op="derivative", source=(f"q{k}",)) for k in (1, 2))


def tried(derive: tuple[DeriveSpec, ...]) -> list[Reading]:
    return list(possible(Setup(TwinSpec("arm", ModelSpec("python"), derive=derive), ARM), ARM))


@pytest.mark.parametrize("derived", [(), (0,), (0, 1)])
def test_what_is_derived_goes_with_what_it_is_derived_from(derived: tuple[int, ...]) -> None:
    found = tried(tuple(SPEEDS[k] for k in derived))
    for k in range(2):
        alone = [one for one in found if one.moved[k] != one.moved[k + 2]]
        assert bool(alone) == (k not in derived)
    assert all(len(set(one.columns)) == len(ARM.inputs) + len(ARM.outputs) for one in found)
    assert any(one.channels == ("q1",) and one.number == -1.0 for one in found)


def test_speeds_are_exchanged_with_their_positions() -> None:
    both = [one for one in tried(SPEEDS) if one.channels == ("q1", "q2") and one.exchanged]
    assert [one.columns for one in both] == [(1, 0, 3, 2, 4, 5)]
    assert not [
        one for one in tried(SPEEDS[:1]) if {"q1", "q2"} == {*one.channels} and one.exchanged
    ]
    assert [one.columns for one in tried(()) if one.said == "q1 and q2 look exchanged"] == [
        (1, 0, 2, 3, 4, 5)
    ]


def test_a_constant_has_no_slope() -> None:
    for one in tried(SPEEDS):
        assert np.array_equal(one.factors[:2], one.factors[2:4]) or one.channels[0].startswith("t")
        assert not one.shifts[2:4].any()
