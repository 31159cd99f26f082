"""FMUs as models: both versions, both interfaces, each way to hold the memory."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.errors import ModelError, UsageError
from evertwin.machines.catalog import machine
from evertwin.models import Model, Restart, check_model, roll
from evertwin.models.corrected.corrected import Corrected, Term
from evertwin.models.fmu import Fmu, fmu
from evertwin.models.functions.function import FunctionModel
from evertwin.models.kernels.kernel import ADOPT, ANEW
from evertwin.models.parameters import Parameters
from evertwin.signals import Layout

from .native import build
from .python_fmu import build as build_python

Open = Callable[..., Fmu]
WAYS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "start values": ({}, {}),
    "start variables": (
        {"exact": False, "interfaces": "c", "STARTS": 1},
        {"states": {"x": "x0", "v": "v0"}},
    ),
    "saved": ({"exact": False, "saves": True}, {}),
    "saved and set": (
        {"exact": False, "saves": True},
        {"memory": "saved", "states": ["x", "v"]},
    ),
    "model exchange": ({}, {"interface": "model-exchange"}),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Open]:
    """Opens an FMU built with some flags; each is built once, all are closed at the end."""
    folder = tmp_path_factory.mktemp("fmus")
    files: dict[str, Path] = {}
    models: dict[str, Fmu] = {}

    def of(flags: dict[str, Any], **options: Any) -> Fmu:
        key = str(sorted({"three": False, **flags}.items()))
        if key not in files:
            files[key] = build(folder / f"f{len(files)}", **flags)
        name = key + str(sorted(options.items()))
        if name not in models:
            models[name] = fmu(files[key], **options)
        return models[name]

    yield of
    for model in models.values():
        model.close()


def plain(step: float = 0.01) -> FunctionModel:
    """The same mass in Python, one Runge-Kutta step a row."""

    def slope(v: float, force: float, p: Any) -> float:
        return float((force - p[1] * np.tanh(v / 0.01) - p[2] * v) / p[0])

    def row(x: Any, u: Any, h: float, p: Any) -> tuple[list[float], list[float]]:
        v, force = float(x[1]), float(u[0])
        b = slope(v, force, p)
        d = slope(v + 0.5 * h * b, force, p)
        f = slope(v + 0.5 * h * d, force, p)
        k = slope(v + h * f, force, p)
        speeds = v + 2.0 * ((v + 0.5 * h * b) + (v + 0.5 * h * d)) + (v + h * f)
        state = [x[0] + h / 6.0 * speeds, v + h / 6.0 * (b + 2.0 * (d + f) + k)]
        return state, [*state, force * state[1]]

    return FunctionModel(
        row, Layout.of(force="N"), Layout.of(x="m", v="m/s", power="W"), Layout.of(x="m", v="m/s"),
        Parameters.of(mass=(2.0, "kg"), fc=(1.5, "N"), fv=(0.5, "Ns/m")),
    )  # fmt: skip


def drive(rows: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(rows) * 0.01
    u = 4.0 * np.sin(2.0 * t) + np.random.default_rng(seed).normal(0, 0.5, rows)
    return u[:, None], np.full(rows, 0.01)


@pytest.mark.parametrize(
    ("way", "three"),
    [*((way, False) for way in WAYS), ("saved and set", True), ("model exchange", True)],
)
def test_laws_and_truth(made: Open, way: str, three: bool) -> None:
    flags, options = WAYS[way]
    model = made({**flags, "three": three}, **options)
    u, dt = drive(40)
    check_model(model, u, dt)
    u, dt = drive(500)
    reference = plain()
    p = reference.parameters.values
    _, wanted = reference.simulate(np.zeros(2), u, dt, p)
    q = model.parameters.values
    _, got = model.simulate(model.initial(q), u, dt, q)
    assert np.abs(got - wanted).max() < 1e-9
    assert model.faults == ()


@pytest.mark.parametrize("way", ["start values", "saved and set", "model exchange"])
def test_position_updates_inside_a_block_reach_the_fmu(made: Open, way: str) -> None:
    flags, options = WAYS[way]
    model, reference = made(flags, **options), plain()
    u, dt = drive(200)
    code = np.zeros(200, dtype=np.uint8)
    code[[30, 31, 90, 150]] = ADOPT
    code[[0, 60, 120]] = ANEW
    rng = np.random.default_rng(1)
    y = np.where(rng.uniform(size=(200, 3)) < 0.7, rng.normal(0, 1, (200, 3)), np.nan)
    results = []
    for m in (model, reference):
        p = m.parameters.values
        x0 = m.initial(p)
        named = len(reference.states)
        x, out = roll(m.kernel(), x0, u, dt, p, Restart(y, code, x0))
        results.append((x[:named], out))
    assert np.abs(results[0][0] - results[1][0]).max() < 1e-9
    assert np.nanmax(np.abs(results[0][1] - results[1][1])) < 1e-9
    assert np.array_equal(np.isnan(results[0][1]), np.isnan(results[1][1]))


def test_parameters_reach_the_fmu_with_units_and_bounds(made: Open) -> None:
    model = made({})
    found = {p.name: p for p in model.parameters}
    assert (found["mass"].unit, found["mass"].low, found["mass"].high) == ("kg", 0.1, 50.0)
    assert found["fv"].unit == "Ns/m" and found["fc"].low == 0.0
    assert model.parameters.editable == ("fc", "fv"), "a fixed one only if it is named"
    assert made({}, parameters=["mass"]).parameters.editable == ("mass",)
    u, dt = drive(100)
    for values in ({"mass": 3.0}, {"fc": 0.2, "fv": 2.0}):
        p = model.parameters.with_values(values).values
        _, got = model.simulate(model.initial(p), u, dt, p)
        _, wanted = plain().simulate(np.zeros(2), u, dt, p)
        assert np.abs(got - wanted).max() < 1e-9


WRAPPERS: dict[str, Callable[[Model], Model]] = {
    "table": lambda m: Corrected(
        m, (Term("table", "force", variant="linear", levels=(-5.0, 0.0, 5.0)),)
    ),
    "lag": lambda m: Corrected(m, (Term("lag", "*"),)),
    "state": lambda m: Corrected(m, (Term("state", "v"),)),
    "of another package": lambda m: Corrected(m, (Term("ramp", "force"),)),
    "law over lag": lambda m: Corrected(
        Corrected(m, (Term("lag", "*"),)), (Term("law", "force", variant="dead zone"),)
    ),
}


@pytest.mark.usefixtures("own_terms")
@pytest.mark.parametrize("wrapper", list(WRAPPERS))
def test_wrappers_run_where_the_fmu_is(made: Open, wrapper: str) -> None:
    wrapped, reference = WRAPPERS[wrapper](made({})), WRAPPERS[wrapper](plain())
    check_model(wrapped, *drive(30))
    values = {"lag.delay": 0.013, "lag.tau": 0.02, "law.force.threshold": 0.3}
    values |= {
        "ramp.force.rate": 9.0,
        "state.v.loss": 0.4,
        "state.v.gain": 0.2,
        "table.force.0": -3.0,
    }
    u, dt = drive(120)
    results = []
    for m in (wrapped, reference):
        named = {k: v for k, v in values.items() if k in m.parameters.names}
        p = m.parameters.with_values(named).values
        code = np.zeros(120, dtype=np.uint8)
        code[[0, 50]] = ANEW
        code[80] = ADOPT
        y = np.full((120, 3), 0.3)
        results.append(roll(m.kernel(), m.initial(p), u, dt, p, Restart(y, code, m.initial(p)))[1])
    assert np.nanmax(np.abs(results[0] - results[1])) < 1e-9
    assert wrapped.kernel().remote is not None, "the loop runs in the child"


def test_rows_in_one_block_are_fast_and_asked_one_by_one_equal(made: Open) -> None:
    model = made({})
    u, dt = drive(20)
    p = model.parameters.values
    local = model.kernel()._replace(remote=None)
    by_row = roll(local, model.initial(p), u, dt, p, Restart.never(20, 3))
    whole = model.simulate(model.initial(p), u, dt, p)
    assert np.array_equal(by_row[1], whole[1]) and np.array_equal(by_row[0], whole[0])


def test_it_can_be_copied_and_comes_from_the_catalog(made: Open, tmp_path: Path) -> None:
    model = made({})
    u, dt = drive(20)
    p = model.parameters.values
    wanted = model.simulate(model.initial(p), u, dt, p)[1]
    again: Fmu = copy.deepcopy(model)
    named = machine("fmu", {"file": str(build(tmp_path)), "inputs": ["force"]})
    for other in (again, named):
        assert np.array_equal(other.simulate(other.initial(p), u, dt, p)[1], wanted)
        other.close()  # type: ignore[union-attr]


def test_events_of_model_exchange(made: Open) -> None:
    """A mass that bounces off the floor keeps half of its speed."""
    model = made({"indicators": 1, "EVENTS": 1}, interface="model-exchange", step=1e-3)
    p = model.parameters.with_values({"fc": 0.0, "fv": 0.0}).values
    _, y = model.simulate(np.array([0.5, -1.0]), np.zeros((100, 1)), np.full(100, 0.01), p)
    assert y[-1, 1] == pytest.approx(0.5) and y[-1, 0] == pytest.approx(0.25, abs=2e-3)
    assert y[40, 1] == pytest.approx(-1.0)


@pytest.mark.parametrize("interface", ["co-simulation", "model-exchange"])
def test_an_fmu_of_time_needs_the_clock(made: Open, interface: str) -> None:
    with pytest.raises(ModelError, match="or depends on time"):
        made({"TIMED": 1}, interface=interface)
    model = made({"TIMED": 1}, interface=interface, clock=True)
    assert model.states.names == ("x", "v", "fmu.time")
    check_model(model, *drive(20))
    u, dt = drive(50)
    p = model.parameters.values
    end, _ = model.simulate(model.initial(p), u, dt, p)
    assert end[2] == pytest.approx(0.5)


REFUSED = {
    "no memory offered": ({"interfaces": "c", "exact": False}, {}, "a twin goes back to earlier"),
    "no such interface": ({"interfaces": "c"}, {"interface": "model-exchange"}, "offers co-sim"),
    "cannot save": ({"interfaces": "c"}, {"memory": "saved"}, "gets, sets and serialises"),
    "fixed and saved": (
        {"saves": True}, {"memory": "saved", "parameters": ["mass"]}, "mass are fixed",
    ),
    "hidden memory": ({"HIDDEN": 1}, {}, "remembers more than x, v"),
    "hidden and static": ({"HIDDEN": 1}, {"memory": "none"}, "remembers more than nothing"),
    "not taken": (
        {"exact": False, "interfaces": "c", "STARTS": 1}, {"states": ["x", "v"]},
        "does not take start values",
    ),
    "unknown unit": ({}, {"units": {"x": "furlongish"}}, "unit that is not known"),
}  # fmt: skip


@pytest.mark.parametrize("case", list(REFUSED))
def test_what_cannot_serve_a_twin_is_refused(made: Open, case: str) -> None:
    flags, options, words = REFUSED[case]
    with pytest.raises(ModelError, match=words):
        made(flags, **options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": ["forse"]}, "did you mean 'force'"),
        ({"solver": "magic"}, "expected one of euler, heun, rk4"),
        ({"step": -1.0}, "expected 0 s or more"),
        ({"row_seconds": 0.0}, "row_seconds: expected a number above 0"),
        ({"states": ["x", "v"], "interface": "model-exchange"}, "model exchange has its own"),
        ({"states": []}, "remembers more"),
    ],
)
def test_options_that_cannot_be_meant(made: Open, options: dict[str, Any], words: str) -> None:
    with pytest.raises((UsageError, ModelError), match=words):
        made({}, **options)


def test_solvers_and_steps(made: Open) -> None:
    """A smaller step of a lower order comes near the reference; a larger one does not."""
    u, dt = drive(50)
    p = plain().parameters.values
    _, wanted = plain().simulate(np.zeros(2), u, dt, p)
    errors = []
    for options in ({"solver": "euler", "step": 0.01}, {"solver": "euler", "step": 1e-4},
                    {"solver": "heun", "step": 1e-3}):  # fmt: skip
        model = made({}, interface="model-exchange", **options)
        _, y = model.simulate(np.zeros(2), u, dt, p)
        errors.append(np.abs(y[:, :2] - wanted[:, :2]).max())
    assert errors[1] < 0.1 * errors[0] and errors[2] < errors[0]


def test_notes_say_what_no_update_reaches(made: Open) -> None:
    text = " ".join(made({}).notes)
    assert "start values of x, v" in text and "no position update reaches power" in text


def test_an_fmu_in_python(tmp_path: Path) -> None:
    """PythonFMU declares no states: named ones take start values. It gives no units."""
    file = build_python(tmp_path)
    with pytest.raises(ModelError, match="offers no way to"):
        fmu(file)
    model = fmu(file, states=["x", "v"], units={"x": "m", "v": "m/s", "force": "N"})
    check_model(model, *drive(20))
    u, dt = drive(200)
    p = model.parameters.with_values({"fc": 0.7}).values
    _, wanted = plain().simulate(np.zeros(2), u, dt, p)
    _, got = model.simulate(model.initial(p), u, dt, p)
    assert np.abs(got - wanted[:, :2]).max() < 1e-9
    assert "no unit is given for mass, fc, fv" in " ".join(model.notes)
    model.close()
