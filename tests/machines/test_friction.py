"""Friction laws: features and force agree, names and tables fit, wrong names are refused."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from evertwin import check_friction
from evertwin.errors import UsageError
from evertwin.machines.friction import Law
from evertwin.machines.friction.kernel import columns_of, fill, force, record_of, switch, width_of
from evertwin.machines.friction.registry import term

TERMS = ("direction", "stribeck", "root", "load")
NAMES = [
    "+".join((switch, *chosen))
    for switch in ("sign", "tanh")
    for size in range(5)
    for chosen in itertools.combinations(TERMS, size)
]


def features(law: Law, v: np.ndarray, load: np.ndarray) -> np.ndarray:
    """The regressor of a law, (n, number of coefficients)."""
    p = np.array([item.value for item in law.parameters()])
    width = width_of(record_of(law, 0), 0, p)
    rows, out = np.array([v, load, v, v]), np.empty((len(law.coefficients), len(v)))
    for column, row in zip(columns_of(law, 0), out, strict=True):
        fill(column, p, rows, law.standstill, width, row)
    return out.T


@pytest.mark.parametrize("name", NAMES)
def test_force_is_features_times_coefficients(name: str) -> None:
    law = Law.parse(name)
    assert str(law) == name
    record, linear = record_of(law, 0), len(law.coefficients)
    rng = np.random.default_rng(1)
    p = np.array([item.value for item in law.parameters("2")])
    p[:linear] = rng.normal(size=linear)
    v, load = rng.uniform(-1, 1, 200), rng.uniform(-50, 50, 200)
    v[0] = 0.0
    expected = features(law, v, load) @ p[:linear]
    rows = [(record, 0, p, a, b, np.nan, np.nan, law.standstill) for a, b in zip(v, load)]
    found = [force.compiled(*row) for row in rows]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found, [force.plain(*row) for row in rows])


def test_every_term_dissipates() -> None:
    law = Law.parse("sign+direction+stribeck+root+load")
    v = np.array([-1.0, -0.01, 0.01, 1.0])
    columns = features(law, v, np.full(4, -7.0))
    offset = 3  # pushes one way; Fv_back acts backwards only
    power = np.delete(columns, offset, axis=1) * v[:, None]
    assert (power >= 0).all() and (power[0] > 0).all()


@pytest.mark.parametrize("name", ["position", "spring", "balance"])
def test_terms_of_the_position_keep_the_laws_of_a_term(name: str) -> None:
    check_friction(term(name))
    assert term(name).cause


def test_a_force_of_rest_takes_nothing_out() -> None:
    law = Law.parse("sign+position+spring+balance")
    assert law.biases() == ("offset", "Ks", "Gc", "Gs")
    assert law.rubbing() == ("Fv", "Fc", "Fqc", "Fqs")


def test_rungs_lead_up_to_the_law() -> None:
    law = Law.parse("tanh+direction+load")
    assert [(r.name, r.add) for r in law.rungs("4")] == [
        ("direction", ("Fv_back4",)), ("load", ("Fl4",))
    ]  # fmt: skip
    assert str(law.without("direction")) == "tanh+load"


def test_standstill_counts_as_rest() -> None:
    assert switch(5e-4, 0.0, 1e-3) == 0.0
    assert switch(-2e-3, 0.0, 1e-3) == -1.0


@pytest.mark.parametrize("name", ["sign+wind", "coulomb", ""])
def test_unknown_laws_are_refused(name: str) -> None:
    with pytest.raises(UsageError, match="friction: "):
        Law.parse(name)


def test_shapes_must_be_above_zero() -> None:
    with pytest.raises(UsageError, match="width > 0"):
        Law.parse("tanh").shaped({"width": 0.0})
