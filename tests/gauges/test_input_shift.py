"""A measured input whose sensor drifts or jumps, a machine that changed, and a turned sign beside a
misfit that was there before."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.errors import UsageError
from evertwin.gauges.rows.in_words import difference, level
from evertwin.gauges.shifts.course import evidence
from evertwin.machines.mobile import Robot1D
from evertwin.models.functions.translated import translated
from evertwin.setup.setup import Setup
from evertwin.sources.spec import ChannelSpec, SourceSpec
from evertwin.sync.spec import SignalSpec
from evertwin.types import Float64, ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, DT = 2700, 1500, 0.05
Columns = dict[str, np.ndarray]


def moved(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    goal = p[0] * u[0] * u[1] / 1e7
    speed = goal + (x[1] - goal) * np.exp(-dt / p[1])
    at = x[0] + 0.5 * dt * (speed + x[1])
    return [at, speed], [at]


def cylinder(seed: int, weaker: float = 1.0) -> Columns:
    """A valve that follows random set-points, at a supply pressure that wanders by itself."""
    rng, at, speed, goal, wander = np.random.default_rng(seed), 0.6, 0.0, 0.6, 0.0
    data = np.empty((ROWS, 4))
    for k in range(ROWS):
        goal = rng.uniform(0.1, 1.1) if k % 60 == 0 else goal
        wander += rng.normal(0.0, 2e5) - 0.02 * wander
        pressure, valve = 1.6e7 + wander, float(np.clip(3.0 * (goal - at), -1.0, 1.0))
        data[k] = DT * k, valve, pressure, at
        gain = 0.25 * (weaker if k >= AT else 1.0)
        for _ in range(5):
            speed += (gain * valve * pressure / 1e7 - speed) * (1.0 - np.exp(-DT / 5 / 0.15))
            at += speed * DT / 5
    data[:, 3] += rng.normal(0.0, 1e-3, ROWS)
    return dict(zip(("t", "valve", "pressure", "position"), data.T, strict=True))


def lived(data: Columns) -> RunResult:
    model = translated(FunctionModel(
        moved, Layout.of(valve="1", pressure="Pa"), Layout.of(position="m"),
        Layout.of(position="m", speed="m/s"), Parameters.of(gain=(0.25, "m/s"), lag=(0.15, "s")),
    ))  # fmt: skip
    spec = TwinSpec(
        "cylinder", ModelSpec("python"), beat=Span(seconds=2.0),
        signals={"pressure": SignalSpec(hold=False)}, prediction=PredictionSpec(1.0),
        anomaly=AnomalySpec(requirement=0.004, relative=False, window=Span(seconds=20.0)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run(data)


@first_of("to", [-5e6, 6e6])
@pytest.mark.parametrize("since", [AT, AT + 1], ids=["drift", "jump"])
def test_an_input_whose_sensor_goes_off_is_named_and_not_learned(to: float, since: int) -> None:
    data = cylinder(3)
    grown = np.linspace(0.0, to, ROWS - AT) if since == AT else np.full(ROWS - AT, to / 2.0)
    data["pressure"][AT:] += grown
    result = lived(data)
    told = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert "pressure looks off by" in told[-1].reason and "its own record" in told[-1].reason
    assert not result.of_kind("promoted")


@first_of("weaker", [0.8, 1.2])
def test_a_cylinder_that_changed_is_tuned(weaker: float) -> None:
    result = lived(cylinder(3, weaker))
    assert result.of_kind("promoted")
    assert not [e for e in result.of_kind("abnormal") if "number" in e.evidence]


def wandering(seed: int) -> Float64[np.ndarray, " n"]:
    rng, record = np.random.default_rng(seed), np.zeros(1500)
    for k in range(1, 1500):
        record[k] = 0.98 * record[k - 1] + rng.normal()
    return record


@pytest.mark.parametrize("seed", range(20))
def test_a_record_tells_its_sensor_from_the_machine(seed: int) -> None:
    """Twelve steps' size, at once: what is in the record is the sensor's, what is not is not."""
    record, off = wandering(seed), np.where(np.arange(1500) >= 1000, 20.0, 0.0)
    assert evidence(record + off, 20.0, (1000, 1000)) > 3.0
    assert evidence(record, 20.0, (1000, 1000)) < -3.0


@pytest.mark.parametrize("seed", range(20))
def test_a_step_from_one_row_to_the_next_stands_out_of_a_slow_course(seed: int) -> None:
    """Within eight rows the record strays by as much as it stepped."""
    rng, t = np.random.default_rng(seed), np.arange(3000)
    slow = sum(rng.normal() * np.sin(2.0 * np.pi * t / p + rng.uniform(0, 6)) for p in (300, 800))
    record, off = 4.0 * slow + rng.normal(0.0, 0.1, 3000), np.where(t >= 2500, 2.0, 0.0)
    assert evidence(record + off, 2.0, (2500, 2500)) > 3.0
    assert evidence(record, 2.0, (2500, 2500)) < 3.0


def hovered(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    z, w = x[0], x[1]
    for _ in range(4):
        w += dt / 4 * (24.0 * u[0] / p[0] - 9.81 - p[1] * w / p[0])
        z += dt / 4 * w
    return [z, w], [z, w]


@first_of("seed", range(3))
def test_a_heavier_machine_in_its_control_loop_is_not_its_commands(seed: int) -> None:
    """The controller gives more thrust once it has sunk: the record is off by as much, later."""
    rng, dt, rows = np.random.default_rng(seed), 0.02, 8000
    z, w, sum_, goal, wait, data = 1.5, 0.0, 0.0, 1.5, 0, np.empty((8000, 3))
    for k in range(rows):
        if wait == 0:
            goal, wait = 1.5 + rng.uniform(-1.0, 1.5), int(rng.integers(100, 400))
        wait, off = wait - 1, goal - z
        sum_ += 0.6 * off * dt
        u = min(max(1.2 * (9.81 + 3.0 * off - 2.5 * w + sum_) / 24.0, 0.05), 1.0)
        data[k], mass = (u, z, w), 1.2 * (1.2 if k >= rows // 2 else 1.0)
        for _ in range(8):
            w += dt / 8 * (24.0 * u / mass - 9.81 - 0.3 * w / mass)
            z += dt / 8 * w
    data[:, 1:] += rng.normal(0.0, (0.01, 0.05), (rows, 2))
    both = Layout.of(z="m", w="m/s")
    model = FunctionModel(
        hovered, Layout.of(thrust="1"), both, both,
        Parameters.of(mass=(1.2, "kg"), drag=(0.3, "Ns/m")),
    )  # fmt: skip
    spec = TwinSpec(
        "lift", ModelSpec("python"), beat=Span(100), prediction=PredictionSpec(1.0),
        anomaly=AnomalySpec(requirement=0.15, relative=False, outputs=("z",), window=Span(500)),
    )  # fmt: skip
    columns = dict(zip(("thrust", "z", "w"), data.T, strict=True))
    with Twin(spec, translated(model)) as twin:
        result = twin.run({"t": dt * np.arange(rows)} | columns)
    assert not result.of_kind("abnormal")
    assert result.of_kind("promoted")
    assert result.champion.p[0] == pytest.approx(1.44, abs=0.05)


def turned(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    push = p[0] * u[0] - p[1] * x[0] - p[2] * np.tanh(x[0] / 0.05)
    speed = x[0] + dt * push / p[3]
    return [speed], [speed]


def winch(seed: int, number: float, rubs: float = 1.0) -> RunResult:
    """Its drum is out of round, it pulls a load and stirs air: none of it is in the model."""
    rng, speed, angle = np.random.default_rng(seed), 0.0, 0.0
    current = np.repeat(rng.uniform(-8.0, 12.0, 88), 25)
    data = np.empty(2200)
    for k in range(2200):
        data[k] = speed + rng.normal(0.0, 0.02)
        more = rubs if k >= 1400 else 1.0
        for _ in range(10):
            load = 1.0 + 1.5 * np.sin(angle) + 0.06 * speed * abs(speed)
            rub = more * (0.8 * speed + np.tanh(speed / 0.05))
            speed += 0.005 * (1.2 * current[k] - rub - load) / 2.0
            angle += 0.005 * speed
    data[1400:] *= number
    model = translated(FunctionModel(
        turned, Layout.of(current="A"), Layout.of(speed="m/s"), Layout.of(speed="m/s"),
        Parameters.of(
            torque=(1.2, "Nm/A"), viscous=(0.8, "Nms/rad"), coulomb=(1.0, "Nm"),
            inertia=(2.0, "kgm^2"),
        ),
    ))  # fmt: skip
    spec = TwinSpec(
        "winch", ModelSpec("python"), beat=Span(seconds=1.0), prediction=PredictionSpec(1.0),
        anomaly=AnomalySpec(requirement=0.15, relative=False, window=Span(seconds=15.0)),
    )  # fmt: skip
    with Twin(spec, model) as twin:
        return twin.run({"t": 0.05 * np.arange(2200), "current": current, "speed": data})


def test_a_turned_sign_is_named_beside_a_misfit_that_was_there_before() -> None:
    result = winch(0, -1.0)
    assert "speed has been in error since row 1400: off by a factor of -1" in result.headline
    assert not result.of_kind("promoted")


def test_a_winch_that_rubs_more_is_read_as_it_is() -> None:
    assert not [e for e in winch(0, 1.0, 2.0).of_kind("abnormal") if "number" in e.evidence]


def test_sizes_and_levels_are_told_as_they_are_recorded() -> None:
    source = SourceSpec("log", channels={"pressure": ChannelSpec("p", unit="bar")})
    spec = TwinSpec("press", ModelSpec("python"), source=(source,))
    model = FunctionModel(
        moved, Layout.of(valve="1", pressure="Pa"), Layout.of(position="m"),
        Layout.of(position="m", speed="m/s"), Parameters.of(gain=(0.25, "m/s"), lag=(0.15, "s")),
    )  # fmt: skip
    setup, channel = Setup(spec, model), model.inputs.channels[1]
    assert difference(setup, channel, 2.5e5) == "+2.5 bar"
    assert difference(setup, model.inputs.channels[0], 0.25) == "+0.25"
    assert level(setup, channel, 1.6e7) == "160 bar"


def test_a_time_that_needs_the_rate_names_its_key() -> None:
    spec = TwinSpec("press", ModelSpec("robot1d"), beat=Span(seconds=3.0))
    setup = Setup(spec, Robot1D())
    with pytest.raises(UsageError, match=r"beat = .*a time needs the rate"):
        setup.rows(spec.beat)
