"""A force that is one number times what it was, by a number that divides two units."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ChannelSpec, ModelSpec, PredictionSpec, SourceSpec, Span
from evertwin.gauges.units.exchanged import exchanged
from evertwin.models import Parameter, Parameters
from evertwin.models.functions.translated import translated
from evertwin.sync.spec import ClockSpec, DeriveSpec, FilterSpec, MovingSpec
from evertwin.tuning.spec import TuningSpec
from planted.draws import first_of


def map_of_steps(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    return x, [p[0] * u[0] + p[1] * np.sign(u[0])]


def lived(number: float, *, bent: float = 0.0) -> RunResult:
    """A tuned map whose output is ``number`` times as large in the last third."""
    rng, n = np.random.default_rng(4), 3600
    t = np.arange(n) * 0.025
    u = np.sin(0.7 * t) + np.sin(0.31 * t + 1.0)
    y = 3.0 * u + 2.0 * np.sign(u)
    late = t >= t[2400]
    y = np.where(late, number * y + bent * u**3, y) + 0.01 * rng.normal(size=n)
    given = Parameters(
        (Parameter("gain", 2.0, "1", -100.0, 100.0), Parameter("step", 1.0, "1", 0.0, 50.0))
    )
    model = translated(
        FunctionModel(map_of_steps, Layout.of(u="1"), Layout.of(y="N"), parameters=given)
    )
    spec = TwinSpec(
        "map", ModelSpec("given"), anomaly=AnomalySpec(requirement=0.05, window=Span(200)),
        prediction=PredictionSpec(horizon=1.0), tuning=TuningSpec(window=Span(1600)),
        beat=Span(80),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run({"t": t, "u": u, "y": y})


@pytest.mark.parametrize(("number", "name"), [(-1.0, "a turned sign"), (4.44822, "newtons")])
def test_a_change_of_unit_or_sign_is_asked_back_and_not_learned(number: float, name: str) -> None:
    result = lived(number)
    told = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert told and told[0].row > 2400 and name in told[0].reason
    assert told[0].evidence["number"] == pytest.approx(number, rel=0.01)
    assert all(e.row < 2400 for e in result.of_kind("promoted"))
    assert name in result.headline and "cannot be told" in result.headline


def test_a_sensor_that_no_longer_answers_is_named_and_not_learned_from() -> None:
    result = lived(0.0)
    assert "no longer answers" in result.headline
    assert all(e.row < 2400 for e in result.of_kind("promoted", "tuned"))


@first_of(("number", "bent"), [(4.44822, 4.0), (1.3, 0.0), (4.2, 0.0)])
def test_a_machine_that_changed_is_none(number: float, bent: float) -> None:
    """By no number of two units, or not by one number in every motion."""
    found = lived(number, bent=bent).of_kind("abnormal")
    assert not any("number" in e.evidence for e in found)


def three_torques(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    return x, p * u


@pytest.mark.parametrize(("crossed", "named"), [((1, 0, 2), True), ((0, 1, 2), False)])
def test_outputs_that_changed_places_are_named_and_not_learned(
    crossed: tuple[int, ...], named: bool
) -> None:
    """Three torques of their own motions; from the last third on the first two are crossed."""
    rng, n = np.random.default_rng(9), 3600
    t = np.arange(n) * 0.025
    u = np.stack([np.sin(w * t) + np.sin(2.3 * w * t + w) for w in (0.7, 0.9, 1.3)], axis=1)
    y = u * (3.0, 5.0, 2.0) + 0.01 * rng.normal(size=u.shape)
    y[2400:] = y[2400:][:, crossed] if named else y[2400:] * (1.2, 1.0, 1.0)
    model = translated(FunctionModel(
        three_torques, Layout.of(a="1", b="1", c="1"),
        Layout.of(ta="Nm", tb="Nm", tc="Nm"), parameters=Parameters.of(
            pa=(2.5, "1"), pb=(5.5, "1"), pc=(2.2, "1")),
    ))  # fmt: skip
    spec = TwinSpec(
        "arm",
        ModelSpec("given"),
        anomaly=AnomalySpec(requirement=0.05, window=Span(200)),
        tuning=TuningSpec(window=Span(1600)),
        beat=Span(80),
    )
    columns = dict(zip(("a", "b", "c", "ta", "tb", "tc"), np.hstack([u, y]).T, strict=True))
    with Twin(spec, model) as twin:
        result = twin.run({"t": t, **columns})
    assert ("ta is what tb would be, tb is what ta would be" in result.headline) == named
    assert any(e.row >= 2400 for e in result.of_kind("tuned", "promoted")) == (not named)


def test_an_input_that_changed_its_unit_is_named_and_no_output_is_called_frozen() -> None:
    """A pump: head and power of speed and flow; the flow is in l/min for m³/h in the last third."""
    rng, n = np.random.default_rng(7), 1800
    speed = 0.5 + 0.5 * np.repeat(rng.uniform(size=90), 20)
    flow = 40.0 * speed * np.repeat(rng.uniform(0.3, 1.0, 60), 30)
    head = 5.2 * speed**2 - 0.0021 * flow**2 + rng.normal(0.0, 0.02, n)
    power = 6.6 * speed**3 + 0.11 * flow * speed**2 + rng.normal(0.0, 0.04, n)
    flow = np.where(np.arange(n) < 1200, flow, flow * 1000.0 / 60.0)

    def step(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
        s, q = u
        return x, [p[0] * s * s - p[1] * q * q, p[2] * s**3 + p[3] * q * s * s]

    given = Parameters.of(a=(5.0, "1"), b=(0.002, "1"), c=(6.0, "1"), d=(0.1, "1"))
    model = translated(FunctionModel(
        step, Layout.of(speed="1", flow="1"), Layout.of(head="1", power="1"), parameters=given
    ))  # fmt: skip
    spec = TwinSpec(
        "pump", ModelSpec("given"), anomaly=AnomalySpec(requirement=0.05, window=Span(100)),
        prediction=PredictionSpec(horizon=1.0), tuning=TuningSpec(window=Span(600)),
        beat=Span(50),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        result = twin.run(
            {"t": 0.1 * np.arange(n), "speed": speed, "flow": flow, "head": head, "power": power}
        )
    told = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert told and {e.signal for e in told} == {"flow"}
    assert told[-1].evidence["number"] == pytest.approx(1000.0 / 60.0, rel=0.01)
    assert "flow looks 16.67 times what it is" in result.headline
    assert "no longer answers" not in result.headline
    assert all(e.row < 1200 for e in result.of_kind("promoted"))


def moved(x: Any, u: Any, dt: float, p: Any) -> tuple[Any, Any]:
    return x, [p[0] * u[1] + p[1] * u[0] + p[2] * np.sign(u[0])]


def pushed_axis(factor: float, *, apart: bool) -> tuple[RunResult, int]:
    """An axis: force of speed and acceleration, both derived; its position from the middle on in
    another unit, or turned. With every number ten times as large the force would be the same.
    ``apart``: that begins between two recordings."""
    rng, rate = np.random.default_rng(3), 50.0
    moves, x = list[np.ndarray](), 0.0
    for target, duration in zip(rng.uniform(-0.4, 0.4, 90), rng.uniform(0.6, 2.0, 90), strict=True):
        s = np.linspace(0.0, 1.0, int(duration * rate))
        moves += [x + (target - x) * (10 * s**3 - 15 * s**4 + 6 * s**5), np.full(15, target)]
        x = target
    position = np.concatenate(moves)
    t = np.arange(len(position)) / rate
    v = np.gradient(position, t)
    force = 20.0 * np.gradient(v, t) + 60.0 * v + 15.0 * np.where(abs(v) > 1e-4, np.sign(v), 0.0)
    position = position + 1e-5 * rng.normal(size=len(t))
    position = np.where(t < t[len(t) // 2], position, factor * position)
    given = Parameters.of(mass=(20.0, "kg"), viscous=(60.0, "Ns/m"), dry=(15.0, "N"))
    model = translated(FunctionModel(
        moved, Layout.of(speed="m/s", acceleration="m/s^2"), Layout.of(force="N"),
        parameters=given,
    ))  # fmt: skip
    channels = {
        "position": ChannelSpec("position", unit="m"),
        "force": ChannelSpec("force", unit="N"),
    }
    spec = TwinSpec(
        "axis", ModelSpec("given"), source=(SourceSpec("log", channels),),
        derive=(
            DeriveSpec(name="speed", op="derivative", source=("position",)),
            DeriveSpec(name="acceleration", op="derivative", source=("speed",)),
        ),
        clock=ClockSpec(rate=rate), filter=FilterSpec(cutoff=5.0),
        moving=MovingSpec(above=0.01, channels={"force": "speed"}, tune=True),
        anomaly=AnomalySpec(requirement=0.05, window=Span(500)),
        prediction=PredictionSpec(horizon=1.0), tuning=TuningSpec(window=Span(3000)),
        beat=Span(100),
    )  # fmt: skip
    noisy = force + 0.3 * rng.normal(size=len(t))
    half, columns = len(t) // 2, {"t": t, "position": position, "force": noisy}
    parts = (slice(half), slice(half, None)) if apart else (slice(None),)
    with Twin(spec, model) as twin:
        return twin.run(
            [{name: one[part] for name, one in columns.items()} for part in parts]
        ), half


@pytest.mark.parametrize("factor", [0.1, -1.0])
def test_a_position_that_is_read_otherwise_is_told_at_its_row(factor: float) -> None:
    result, half = pushed_axis(factor, apart=False)
    (told,) = [e for e in result.of_kind("measurement_error") if e.signal == "position"]
    assert told.row == half and f"are {factor:g} times what they were" in told.reason
    assert not result.of_kind("promoted") and not result.of_kind("external")


@pytest.mark.parametrize(
    ("factor", "signal", "said"),
    [
        (0.1, "position", "position looks 0.1 times what it is"),
        (-1.0, "force", "as a turned sign would make it"),
    ],
)
def test_a_position_that_was_read_otherwise_is_named_though_only_derivatives_are_used(
    factor: float, signal: str, said: str
) -> None:
    result, half = pushed_axis(factor, apart=True)
    told = [e for e in result.of_kind("abnormal") if e.signal == signal]
    assert told and said in told[0].reason and not result.of_kind("promoted")
    assert told[0].row < half + 1500


@pytest.mark.parametrize("seed", range(5))
def test_crossed_cables_exchange_what_is_recorded(seed: int) -> None:
    """Two motor currents, each with its own constant: as torques neither is what the other was."""
    rng = np.random.default_rng(seed)
    sizes = rng.permutation([8.0, 14.0, 24.0, 41.0])
    expected = rng.normal(0.0, 10.0, (300, 4))
    recorded = (expected + rng.normal(0.0, 0.1, expected.shape)) / sizes
    crossed = recorded[:, [0, 3, 2, 1]] * sizes
    assert exchanged(crossed, expected, ("Nm",) * 4) == (0, 1, 2, 3)
    assert exchanged(crossed, expected, ("Nm",) * 4, sizes) == (0, 3, 2, 1)
