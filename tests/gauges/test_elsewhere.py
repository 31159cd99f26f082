"""Off where the inputs had never been: neither a sensor nor the machine is blamed for it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, Span, TwinSpec
from evertwin.fold import Windows, make_block
from evertwin.gauges.changes.unseen_inputs import elsewhere
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from evertwin.types import Vector
from planted.draws import first_of

ROWS, AT = 1600, 1000
SEEDS = first_of("seeds", [range(3), range(10)])


def line(x: Any, u: Any, dt: float, p: Any) -> Any:
    return x, [p[0] * u[0] + p[1] * u[1]]


LINE = translated(FunctionModel(
    line,
    Layout.of(load="N", room="K"), Layout.of(power="W"),
    parameters=Parameters.of(k=(2.0, "W/N"), c=(0.1, "W/K")),
))  # fmt: skip


def said(seed: int, *, more: float = 0.0, bent: float = 0.0, gain: float = 1.0,
         strays: float = 0.0, seen: float = 0.0, later: int = 0, peek: int = 0) -> str:  # fmt: skip
    """What is told of a load that is ``more`` from AT on, or so many rows ``later``, of a machine
    that is ``bent`` beyond its range and has another ``gain`` since AT; the room strays all the
    while. Before the rows that are kept the load had been as large as ``seen``; on the few rows of
    a ``peek`` it had been as large as any later one."""
    rng, late = np.random.default_rng(seed), np.arange(ROWS) >= AT
    load = np.repeat(rng.uniform(1.0, 5.0, ROWS // 20), 20)
    load += more * (np.arange(ROWS) >= AT + later)
    load[500 : 500 + peek] = load.max() + 0.1
    room: Vector = 293.0 + strays * np.linspace(-1.0, 1.0, ROWS) + rng.normal(0.0, 0.05, ROWS)
    power = 2.0 * load * np.where(late, gain, 1.0) + bent * late * np.maximum(load - 5.0, 0.0) ** 2
    y = (power + 0.1 * room + rng.normal(0.0, 0.1, ROWS))[:, None]
    windows = (make_block(t=np.arange(ROWS) * 10**9, u=np.c_[load, room], y=y),)
    anomaly = AnomalySpec(0.05, window=Span(300))
    setup = Setup(TwinSpec("line", ModelSpec("python"), anomaly=anomaly), LINE)

    def pose(some: Windows) -> Problem:
        return Problem(LINE, some)

    problem = pose(windows)
    before = np.array([[0.0, np.inf], [seen, -np.inf]]) if seen else None
    rows = Rows(setup, pose, windows, problem, solve(problem), solve, seen=before)
    found = elsewhere(rows)
    return found.said if found else ""


@SEEDS
@pytest.mark.parametrize("more", [2.0, 4.0, 8.0])
def test_a_form_that_does_not_hold_elsewhere_blames_nobody(more: float, seeds: range) -> None:
    told = [said(seed, more=more, bent=0.5) for seed in seeds]
    assert sum("load was never above" in one for one in told) >= 0.9 * len(seeds)


@SEEDS
@first_of("strays", [0.0, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("gain", [0.8, 1.3])
def test_a_machine_that_changed_where_it_was_known_is_one(
    gain: float, strays: float, seeds: range
) -> None:
    assert not any(said(seed, gain=gain, strays=strays) for seed in seeds)


@SEEDS
def test_a_form_that_holds_elsewhere_says_nothing(seeds: range) -> None:
    assert not any(said(seed, more=4.0) for seed in seeds)


@SEEDS
def test_what_it_saw_on_a_few_rows_is_not_called_never(seeds: range) -> None:
    told = [said(seed, more=8.0, bent=0.5, peek=5) for seed in seeds]
    assert sum("load was hardly ever above" in one for one in told) >= 0.9 * len(seeds)
    assert not any("was never" in one for one in told)


@SEEDS
def test_where_the_inputs_had_been_before_the_kept_rows_a_machine_changed(
    seeds: range,
) -> None:
    """A floor that changes while set speeds turn round was learned never: all kept rows before had
    gone the other way."""
    assert all(said(seed, more=8.0, gain=1.3) for seed in seeds)
    assert not any(said(seed, more=8.0, gain=1.3, seen=14.0) for seed in seeds)
    assert all("above 6" in said(seed, more=8.0, gain=1.3, seen=6.0) for seed in seeds)


@SEEDS
def test_a_machine_that_changed_before_it_went_elsewhere_is_one(seeds: range) -> None:
    """Rows in between are off as well, inside the range."""
    assert not any(said(seed, more=14.0, gain=1.3, later=50) for seed in seeds)
