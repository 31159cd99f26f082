"""Corrected models: laws, terms against plain arithmetic, compiled against uncompiled."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.compiled.functions import STEP, CFunction
from evertwin.errors import UsageError
from evertwin.machines.mobile import Differential, Robot1D
from evertwin.models import check_model
from evertwin.models.corrected.corrected import Corrected, build
from evertwin.models.corrected.variants import in_variant
from evertwin.models.form import Form, Term
from evertwin.models.functions.function import FunctionModel
from evertwin.models.terms import kernel
from evertwin.models.terms.contract import Functions
from evertwin.models.terms.registry import kind
from evertwin.signals import Layout

GRID = (-1.0, -0.25, 0.0, 0.5, 1.0)
TERMS = {
    "table": Term("table", "v", levels=GRID),
    "linear table": Term("table", "v", variant="linear", levels=GRID),
    "law": Term("law", "v"),
    "dead zone": Term("law", "v", variant="dead zone"),
    "clamp": Term("law", "v", variant="clamp", levels=(0.1,)),
    "lag": Term("lag", "*"),
    "lag of one": Term("lag", "w", levels=(4.0,)),
    "delay": Term("lag", "*", variant="delay"),
    "proportional": Term("coupling", "v", "w", variant="proportional"),
    "magnitude": Term("coupling", "v", "w", variant="magnitude"),
    "grip": Term("coupling", "v", "w", variant="grip"),
    "share": Term("coupling", "v", "w", variant="share"),
    "surface": Term("surface", "v", "w", levels=GRID, levels2=GRID),
    "state": Term("state", "x"),
    "lever": Term("lever", "*"),
    "current": Term("current", "*"),
}


def random_parameters(model: Corrected, seed: int = 0) -> np.ndarray:
    """Inner values as they are, terms' values at random in (0, 0.5)."""
    p = model.parameters.values
    inner = len(model.model.parameters)
    p[inner:] = np.random.default_rng(seed).uniform(0, 0.5, len(p) - inner)
    return p


def with_values(model: Corrected, p: np.ndarray) -> Corrected:
    items = model.parameters.with_values(p)
    object.__setattr__(model, "parameters", items)
    return model


@pytest.mark.parametrize("name", TERMS)
def test_neutral_terms_change_nothing(name: str) -> None:
    base = Differential()
    model = Corrected(base, (TERMS[name],))
    # a nearest-level table is neutral only on its levels
    u = np.random.default_rng(0).choice(GRID, (30, 2))
    p, dt = model.parameters.values, np.full(30, 0.1)
    y = model.simulate(model.initial(p), u, dt, p)[1]
    assert np.allclose(y, base.simulate(np.zeros(3), u, dt, base.parameters.values)[1], atol=1e-12)


@pytest.mark.parametrize("name", TERMS)
def test_laws_of_the_contract(name: str) -> None:
    model = Corrected(Differential(), (TERMS[name],))
    check_model(with_values(model, random_parameters(model)))


def test_laws_hold_for_a_whole_stack_and_a_stack_on_a_stack() -> None:
    inner = Corrected(Differential(), (TERMS["dead zone"], TERMS["grip"], TERMS["lag"]))
    outer = Corrected(inner, (TERMS["surface"], TERMS["lag of one"], TERMS["state"]))
    check_model(with_values(outer, random_parameters(outer)))


@pytest.mark.parametrize("name", TERMS)
def test_compiled_equals_plain(name: str) -> None:
    """Bit for bit: every term's functions run by Python itself, row after row."""
    model = Corrected(Differential(), (TERMS[name], Term("lag", "*"), TERMS["magnitude"]))
    p, rng = random_parameters(model), np.random.default_rng(1)
    x = model.initial(p)
    for _ in range(40):
        u = rng.choice(np.linspace(-1.2, 1.2, 7), 2)
        dt = float(rng.choice([0.02, 0.3]))
        end, y = model.simulate(x, u[None], np.array([dt]), p)
        ahead, inputs = x.copy(), u.copy()
        for own, at, grid, q in parts(model):
            if own.before is not None:
                memory = ahead[at[kernel.MEMORY - kernel.PLACE] :]
                assert plain(own.before)(at, grid, inputs, dt, p[q:], memory) == 0
        inner, out = Differential().simulate(x[:3], inputs[None], np.array([dt]), p[:2])
        ahead[:3], row = inner, out[0].copy()
        for own, at, _, q in parts(model):
            if own.after is not None:
                assert plain(own.after)(at, dt, p[q:], x, ahead, row) == 0
        assert np.array_equal(ahead, end)
        assert np.array_equal(row, y[0])
        x = end
    measured = np.array([1.0, np.nan, 0.3])
    adopted, before = model.observe(x, measured), x.copy()
    x[0], x[2] = 1.0, 0.3
    for own, at, _, _ in parts(model):
        if own.adopted is not None:
            assert plain(own.adopted)(at, before[:3], x) == 0
    assert np.array_equal(adopted, x)


def parts(model: Corrected) -> Iterator[tuple[Functions, np.ndarray, np.ndarray, int]]:
    """Functions, place, grids and first parameter of every term, from the model's plan."""
    at = kernel.HEADER
    for term in model.terms:
        record = model.plan[at : at + model.plan[at]]
        place, grids = record[kernel.PLACE : kernel.RECORD], record[kernel.RECORD :]
        functions = kind(term.kind).functions
        yield functions, place, grids.view(np.float64), int(record[kernel.PARAMETER])
        at += len(record)


def plain(function: Any) -> Any:
    """A function run by Python itself, with the compiled ones that it calls."""
    return CFunction(inspect.unwrap(function), STEP, {}).plain


def effective(term: Term, values: list[float], u: np.ndarray, dt: float = 1.0) -> np.ndarray:
    """What the term makes of the first input: differences of the position of a naive robot."""
    model = Corrected(Robot1D(), (term,))
    p = np.array([1.0, *values])
    y = model.simulate(model.initial(p), u.reshape(-1, 1), np.full(len(u), dt), p)[1]
    return np.diff(y[:, 0], prepend=0.0) / dt


def test_table_takes_the_nearest_level() -> None:
    term = Term("table", "v", levels=(0.0, 1.0, 2.0))
    u = np.array([-1.0, 0.2, 0.6, 1.4, 2.5])
    assert effective(term, [0.0, 0.5, 3.0], u) == pytest.approx([-1.0, 0.0, 0.5, 0.5, 3.5])
    between = Term("table", "v", variant="linear", levels=(0.0, 1.0, 2.0))
    assert effective(between, [0.0, 0.5, 3.0], u) == pytest.approx([-1.0, 0.1, 0.3, 1.5, 3.5])


def test_laws_are_odd_with_threshold_and_cap() -> None:
    u = np.array([-20.0, -3.0, 0.3, 0.0, 3.0, 6.0, 7.0, 20.0])
    dead = Term("law", "v", variant="dead zone")
    assert effective(dead, [6.0, 1.0, 0.5, 16.0], u) == pytest.approx(
        [-16.0, 0, 0, 0, 0, 0, 7.5, 16.0]
    )
    clamp = Term("law", "v", variant="clamp", levels=(0.5,))
    assert effective(clamp, [6.0, 1.0, 0.0, 16.0], u) == pytest.approx(
        [-16.0, -6.0, 0, 0, 6.0, 6.0, 7.0, 16.0]
    )


def test_couplings() -> None:
    u = np.array([[0.1, -0.4], [-0.1, 0.4], [0.0, 0.4]])

    def forward(variant: str, values: list[float]) -> np.ndarray:
        model = Corrected(Differential(), (Term("coupling", "v", "w", variant=variant),))
        p = np.array([1.0, 0.0, *values])  # no turning: x is the integral of v
        return np.diff(model.simulate(np.zeros(3), u, np.ones(3), p)[1][:, 0], prepend=0.0)

    assert forward("proportional", [0.1]) == pytest.approx([0.14, -0.14, -0.04])
    assert forward("magnitude", [0.1]) == pytest.approx([0.06, -0.06, 0.0])
    limit = 1 / (1.0 + 20.0 * 0.4)
    held = limit * math.tanh(1.1 * 0.1 / limit)
    assert forward("grip", [1.1, 1.0, 20.0]) == pytest.approx([held, -held, 0.0])
    assert forward("share", [0.5, 1.5]) == pytest.approx([0.02, -0.02, 0.0])
    assert forward("share", [0.5, 3.0]) == pytest.approx([0.0, 0.0, 0.0])


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 0.7), st.floats(0.0, 1.0), st.integers(1, 7), st.integers(0, 1000))
def test_lag_is_exact_however_the_rows_are_cut(
    delay: float, tau: float, cut: int, seed: int
) -> None:
    """Fine rows against coarse ones, commands changing on the coarse grid: same positions."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([0.0, 0.1, 0.2], 6), 2)
    coarse = effective(Term("lag", "*"), [delay, tau], u, 0.3).cumsum()
    fine = effective(Term("lag", "*"), [delay, tau], np.repeat(u, cut), 0.3 / cut).cumsum() / cut
    assert fine[cut - 1 :: cut] == pytest.approx(coarse, abs=1e-9)


def test_lag_of_a_step_is_the_textbook_answer() -> None:
    u = np.r_[0.0, np.ones(40)]
    v = effective(Term("lag", "*"), [0.25, 0.5], u, 0.1)
    t = np.arange(41) * 0.1 - 0.25
    way = np.where(t > 0, t - 0.5 * (1 - np.exp(-np.maximum(t, 0) / 0.5)), 0.0)
    assert v.cumsum() * 0.1 == pytest.approx(way, abs=1e-9)


def test_an_unknown_input_fails_the_row_and_leaves_the_memory() -> None:
    model = Corrected(Robot1D(), (Term("lag", "*"),))
    p = np.array([1.0, 0.1, 0.1])
    u = np.array([[1.0], [np.nan], [1.0]])
    _, y = model.simulate(model.initial(p), u, np.full(3, 0.1), p)
    assert np.isnan(y[:, 0]).tolist() == [False, True, False]
    assert y[2, 0] == pytest.approx(0.2)


def test_an_extra_state_exchanges_and_conserves() -> None:
    box = FunctionModel(
        lambda x, u, dt, p: ([x[0] + dt * u[0]],) * 2, Layout.of(q="K/s"), Layout.of(T="K"),
        Layout.of(T="K"),
    )  # fmt: skip
    model = Corrected(box, (Term("state", "T"),))
    p = np.array([0.3, 0.1, -4.0])  # loses 0.3/s towards a wall that is 4 K colder
    x = model.observe(model.initial(p), np.array([20.0]))
    end, y = model.simulate(x, np.zeros((5, 1)), np.ones(5), p)
    d = 4.0 * math.exp(-0.4 * 5)
    assert y[-1, 0] == pytest.approx(20 - 0.75 * (4 - d))
    assert end[2] == pytest.approx(-d)
    wall = end[0] + end[2]
    moved = model.observe(end, np.array([30.0]))
    assert moved[0] + moved[2] == pytest.approx(wall)  # adopting T leaves the wall alone


def test_delayed_is_a_model() -> None:
    check_model(Corrected(Differential(), (Term("lag", "*", variant="delay"),)))


def test_build() -> None:
    base = Robot1D()
    assert build(base, Form()) is base
    model = build(base, Form((Term("law", "v"), Term("law", "v"))))
    assert model.parameters.names[-3:] == ("law.v#2.gain", "law.v#2.offset", "law.v#2.cap")
    with pytest.raises(UsageError, match="with variants"):
        build(base, Form(variant=(("friction", "sign"),)))
    static = FunctionModel(lambda x, u, dt, p: ([], [u[0]]), Layout.of(v="1"), Layout.of(y="1"))
    with pytest.raises(UsageError, match=r"static map|no channel"):
        build(static, Form((Term("state", "T"),)))


class Two(Robot1D):
    """A robot with an aspect."""

    variant: ClassVar[dict[str, str]] = {"law": "a"}

    def variants(self) -> dict[str, tuple[str, ...]]:
        return {"law": ("a", "b")}

    def with_variant(self, choice: dict[str, str]) -> Two:
        return Two()


def test_variants() -> None:
    assert isinstance(in_variant(Two(), {"law": "b"}), Two)
    with pytest.raises(UsageError, match="expected one of"):
        in_variant(Two(), {"law": "c"})


@pytest.mark.parametrize(
    ("term", "match"),
    [
        (Term("law", "v", variant="deadzone"), "variant"),
        (Term("law", "speed"), "no channel"),
        (Term("coupling", "v", "speed", variant="grip"), "no channel"),
        (Term("law", "v", "w"), "no second channel"),
        (Term("table", "v", levels=(1.0, 1.0)), "rising"),
    ],
)
def test_misuse(term: Term, match: str) -> None:
    with pytest.raises(UsageError, match=match):
        Corrected(Differential(), (term,))


def test_a_state_of_another_size_is_refused() -> None:
    model = Corrected(Robot1D(), (Term("lag", "*"),))
    with pytest.raises(UsageError, match="initial"):
        model.simulate(np.zeros(1), np.zeros((1, 1)), np.ones(1), model.parameters.values)
