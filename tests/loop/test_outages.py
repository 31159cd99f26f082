"""A line that is cut is no fault of the machine, and one that clogs while its numbers are on trial
is one that changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.fold import Chunk
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from planted.draws import first_of

FAULTS = ("suspected", "abnormal", "changed", "tuned", "drift", "overruled")


def cart(period: float) -> TwinSpec:
    """A cart told ``period`` [s] by period, its gain as it is."""
    length = replace(spec.TwinSpec("cart", spec.ModelSpec("robot1d")), beat=spec.Span(20))
    return replace(
        length,
        model=spec.ModelSpec("robot1d", parameters={"gain": spec.ParameterSpec(value=0.95)}),
        prediction=spec.PredictionSpec(horizon=20 * period),
        arbiter=spec.ArbiterSpec(use="tolerance", tolerance=0.2 * period),
        anomaly=spec.AnomalySpec(requirement=0.1 * period, relative=False, window=spec.Span(300)),
    )


def driven(seed: int, period: float, rows: int = 3000) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    speeds = rng.uniform(0.05, 0.3, rows) * rng.choice([-1, 1], rows)
    v = np.repeat(speeds, rng.integers(20, 60, rows))[:rows]
    x = np.r_[0.0, np.cumsum(0.95 * period * v[:-1])]
    noise = rng.normal(0.0, 0.01 * period, rows)
    return {"t": period * np.arange(rows), "v": v, "x": x + noise}


def without(table: dict[str, np.ndarray], *outages: tuple[int, int]) -> dict[str, np.ndarray]:
    kept = np.ones(len(table["t"]), dtype=bool)
    for first, length in outages:
        kept[first : first + length] = False
    return {name: column[kept] for name, column in table.items()}


@first_of("seed", range(5))
@first_of("period", [0.1, 60.0])
def test_an_outage_of_the_line_is_no_fault_of_the_machine(seed: int, period: float) -> None:
    table = driven(seed, period)
    cut = without(table, (1500, 40), (1900, 80), (2300, 600))
    held = Twin(replace(cart(period), clock=spec.ClockSpec(gap=1e9))).run(cut)
    assert held.of_kind(*FAULTS)  # predictions that run over what nobody saw
    for data in (table, cut):
        result = Twin(cart(period)).run(data)
        assert not result.of_kind(*FAULTS)
        assert result.outputs["x"].rms_after < 0.05 * period
        assert bool(result.of_kind("gap")) == (data is cut)


@pytest.mark.parametrize("seed", range(5))
def test_a_command_that_is_sent_where_it_changes_is_held(seed: int) -> None:
    table = driven(seed, 0.1)
    changes = np.flatnonzero(np.r_[True, np.diff(table["v"]) != 0.0])
    sources = tuple(
        spec.SourceSpec(name, channels={channel: spec.ChannelSpec(channel, unit)})
        for name, channel, unit in (("command", "v", "m/s"), ("pose", "x", "m"))
    )
    twin = Twin(replace(cart(0.1), source=sources))
    stamps = np.round(table["t"] * 1e9).astype(np.int64)
    told, seen = 0, 0
    for stop in (*range(100, 3000, 100), 3000):
        mine = changes[(changes >= told) & (changes < stop)]
        for row in mine.tolist():
            at = slice(row, row + 1)
            twin.push(Chunk("command", stamps[at], table["v"][at, None]))
        twin.push(Chunk("pose", stamps[seen:stop], table["x"][seen:stop, None]))
        told = seen = stop
    assert not [event for event in twin.events if event.kind in (*FAULTS, "gap")]


def tank_level(x, u, dt, p):  # type: ignore[no-untyped-def]
    level = max(x[0] + dt * (u[0] - p[0] * max(x[0], 0.0) ** 0.5) / 0.02, 0.0)
    return [level], [level]


def clogging(seed: int, at: int) -> dict[str, np.ndarray]:
    """A tank at 10 Hz whose outlet clogs from row ``at`` on."""
    rng = np.random.default_rng(seed)
    q = np.repeat(rng.uniform(0.0003, 0.0019, 300), rng.integers(40, 100, 300))[:3000]
    level, h = np.zeros(3000), 0.4
    for k in range(3000):
        level[k] = h
        for _ in range(10):
            h = max(h + 0.01 * (q[k] - (0.002 if k < at else 0.0015) * h**0.5) / 0.02, 0.0)
    return {"t": 0.1 * np.arange(3000), "inflow": q, "level": level + rng.normal(0, 0.001, 3000)}


@first_of("seed", range(5))
def test_a_clog_while_its_numbers_are_on_trial_is_a_change(seed: int) -> None:
    model = translated(FunctionModel(
        tank_level, Layout.of(inflow="m^3/s"), Layout.of(level="m"), Layout.of(level="m"),
        Parameters((Parameter("outflow", 0.0018, "1", low=0.0002, high=0.01),)),
    ))  # fmt: skip
    settings = TwinSpec(
        "tank", spec.ModelSpec("x"), beat=spec.Span(20),
        prediction=spec.PredictionSpec(horizon=5.0),
        anomaly=spec.AnomalySpec(requirement=0.01, relative=False, window=spec.Span(300)),
        tuning=spec.TuningSpec(window=spec.Span(1200), causes={"clogged": ("outflow",)}),
    )  # fmt: skip
    result = Twin(settings, model).run(clogging(seed, 600))
    assert not result.of_kind("abnormal")
    (found,) = result.of_kind("changed")
    assert abs(found.evidence["row"] - 600) <= 20  # type: ignore[operator]
    assert result.parameters["outflow"].value == pytest.approx(0.0015, rel=0.03)


def leaking(x, u, dt, p):  # type: ignore[no-untyped-def]
    held = 2.718281828459045 ** (-p[1] * dt)
    level = x[0] * held + p[0] / p[1] * (1.0 - held) * u[0]
    return [level], [level]


@first_of("seed", range(4))
def test_what_follows_a_gap_without_any_noise_is_in_no_other_unit(seed: int) -> None:
    """It misses smoothly what its model is off by: that is less than usual, as a factor's noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.0, 1.0, 200), rng.integers(20, 90, 200))[:2000]
    y = np.zeros(2000)
    for k in range(1, 2000):
        y[k] = leaking([y[k - 1]], [u[k - 1]], 0.02, [2.02, 1.01])[0][0]
    t = 0.02 * np.arange(2000) + np.arange(2000) // 500  # a second's gap before each part
    model = translated(FunctionModel(
        leaking, Layout.of(u="1"), Layout.of(y="1"), Layout.of(y="1"),
        Parameters((Parameter("gain", 1.95, "1/s"), Parameter("leak", 0.93, "1/s", low=1e-3))),
    ))  # fmt: skip
    settings = TwinSpec(
        "leak", spec.ModelSpec("x"), beat=spec.Span(20),
        prediction=spec.PredictionSpec(horizon=0.2),
        anomaly=spec.AnomalySpec(requirement=0.005, relative=False, window=spec.Span(125)),
        tuning=spec.TuningSpec(window=spec.Span(400)),
    )  # fmt: skip
    result = Twin(settings, model).run({"t": t, "u": u, "y": y})
    assert not result.of_kind("measurement_error", "overruled")
    assert result.parameters["leak"].value == pytest.approx(1.01, rel=1e-3)
