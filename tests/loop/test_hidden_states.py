"""A state that nothing measures: what a recording began with is no fault of the machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.fold import copy, make_block
from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.follow import EMPTY
from evertwin.loop.decisions.going_live import goes_live
from evertwin.loop.driver import Driver
from evertwin.models import FunctionModel, Model, Parameters
from evertwin.models.form import Form
from evertwin.models.functions.translated import translated
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from planted.draws import first_of

FAULTS = ("suspected", "abnormal", "changed", "tuned", "drift")
DT, SIGMA = 5.0, 0.05
Table = dict[str, np.ndarray]


def vessel(conductance: float = 8.0) -> Model:
    """Gas that is measured in a wall that is not; their heat capacities and conductances."""

    def step(x, u, dt, p):  # type: ignore[no-untyped-def]
        gas, wall = x
        inner, outer, between, away = p
        parts = int(dt) + 1
        for _ in range(parts):
            flow = between * (gas - wall)
            gas += dt / parts * (u[0] - flow) / inner
            wall += dt / parts * (flow - away * (wall - u[1])) / outer
        return [gas, wall], [gas]

    numbers = Parameters.of(
        inner=(2000.0, "J/K"), outer=(20000.0, "J/K"), between=(40.0, "W/K"),
        away=(conductance, "W/K"),
    )  # fmt: skip
    return translated(
        FunctionModel(
            step, Layout.of(power="W", room="K"), Layout.of(gas="K"),
            Layout.of(gas="K", wall="K"), numbers, (293.15, 293.15),
        )
    )  # fmt: skip


def recorded(seed: int, conductance: float = 8.0, rows: int = 4000) -> Table:
    rng = np.random.default_rng(seed)
    model = vessel(conductance)
    power = np.repeat(rng.choice([0.0, 300.0, 800.0, 1500.0], rows // 80), 80)
    u = np.stack([power, np.full(rows, 294.0)], axis=1)
    p = model.parameters.values
    held = np.concatenate([u[:1], u[:-1]])  # a command holds from its stamp on
    y = model.simulate(model.initial(p), held, np.full(rows, DT), p)[1][:, 0]
    t = DT * np.arange(rows)
    return {"t": t, "power": power, "room": u[:, 1], "gas": y + rng.normal(0.0, SIGMA, rows)}


def twin() -> Twin:
    told = replace(spec.TwinSpec("vessel", spec.ModelSpec("python")), beat=spec.Span(100))
    told = replace(
        told,
        prediction=spec.PredictionSpec(horizon=500.0),
        anomaly=spec.AnomalySpec(requirement=0.4, relative=False, window=spec.Span(400)),
    )
    assert isinstance(told, TwinSpec)
    return Twin(told, vessel())


def kept(table: Table, rows: np.ndarray) -> Table:
    return {name: column[rows] for name, column in table.items()}


@first_of("seed", range(5))
@pytest.mark.parametrize("fault", ["cut", "outage", "gaps"])
def test_rows_that_are_missing_accuse_no_machine(fault: str, seed: int) -> None:
    table = recorded(seed)
    rng, rows = np.random.default_rng(seed), np.ones(4000, dtype=bool)
    if fault == "cut":
        rows[:1234] = False
    elif fault == "outage":
        rows[2500:3200] = False
    else:
        for first in rng.integers(100, 3800, 30).tolist():
            rows[first : first + int(rng.integers(3, 30))] = False
    result = twin().run(kept(table, rows))
    assert not result.of_kind(*FAULTS)
    assert bool(result.of_kind("gap")) == (fault != "cut")
    assert result.outputs["gas"].rms_after < 3 * SIGMA


@first_of("seed", range(5))
def test_a_change_is_told_all_the_same(seed: int) -> None:
    whole, later = recorded(seed), recorded(seed, 10.0)
    rows = np.arange(4000) >= 1234
    table = {name: np.where(np.arange(4000) < 2400, whole[name], later[name]) for name in whole}
    result = twin().run(kept(table, rows))
    first = result.of_kind(*FAULTS)[0]
    assert 2400 - 1234 < first.row < 2400 - 1234 + 800


@first_of("seed", range(4))
def test_a_version_held_in_its_trial_whatever_its_hidden_state_had_come_to(seed: int) -> None:
    """The wall is warm when the trial begins; a simulation from the start has it cold."""
    setup, table = Setup(twin().spec, vessel()), recorded(seed)
    versions = Versions(setup.model)
    driver = Driver(setup, versions, lambda row, said: None)
    held = np.r_[table["power"][:1], table["power"][:-1]]  # from its stamp on
    u = np.stack([held, table["room"]], axis=1)
    rows = make_block((table["t"] * 1e9).astype(np.int64), u, table["gas"][:, None])
    state = driver.run([rows])
    for away, holds in ((8.0, True), (9.5, False)):
        number = versions.add(Form(), {"away": away}, parent=0, reason="tuned", row=3200).number
        tried = copy(state)._replace(other=driver.follow.beside(copy(state.live), number))
        live = goes_live(driver.follow, tried, number, copy(state.live), EMPTY)
        assert live.agenda.held == holds
