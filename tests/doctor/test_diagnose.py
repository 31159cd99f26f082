"""The doctor names what was planted, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import (
    AnomalySpec,
    ArbiterSpec,
    CorrectionSpec,
    IndicatorSpec,
    ModelSpec,
    ParameterSpec,
    PredictionSpec,
    SignalSpec,
    TuningSpec,
    TwinSpec,
)
from evertwin.doctor import Diagnosis, Finding
from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.models.functions.translated import translated
from evertwin.signals import Layout
from evertwin.twin import Twin
from planted.draws import first_of

SPEC = TwinSpec(
    "robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
    arbiter=ArbiterSpec(use="tolerance", tolerance=0.03),
    anomaly=AnomalySpec(requirement=0.01, relative=False),
)  # fmt: skip


def drive(
    rows: int = 1500, gain: float = 0.9, noise: float = 0.001, lag: float = 0.0
) -> dict[str, Any]:
    """A robot on a line at 10 Hz; ``lag`` delays its response by whole seconds' parts."""
    rng = np.random.default_rng(5)
    t = 0.1 * np.arange(rows)

    def command(at: np.ndarray) -> np.ndarray:
        return np.asarray(0.1 * np.sin(0.9 * at) + 0.08 * np.sin(2.3 * at) + 0.02)

    fine = np.arange(rows * 20) * 0.005
    held = command(np.floor((fine - lag) / 0.1 + 1e-9) * 0.1)
    x = np.concatenate([[0.0], np.cumsum(0.005 * gain * held[:-1])])[::20]
    return {"t": t, "v": command(t), "x": x + rng.normal(0.0, noise, rows)}


def kinds(found: Diagnosis) -> list[str]:
    return [item.kind for item in found.findings]


@pytest.mark.parametrize(
    ("factor", "said"),
    [(39.3701, "inches taken for metres"), (3.28084, "feet taken for metres"), (100.0, "10^-2")],
)
@pytest.mark.parametrize("channel", ["x", "v"])
def test_a_unit_of_length_is_named(factor: float, said: str, channel: str) -> None:
    rows = drive(gain=1.0)
    rows[channel] = rows[channel] * factor
    (finding,) = Twin(SPEC).doctor(rows).of_kind("unit")
    hypotheses = finding.evidence["hypotheses"]
    assert [channel] in [list(one["channels"]) for one in hypotheses] and said in finding.reason


def test_a_sound_twin_has_no_findings() -> None:
    found = Twin(SPEC).doctor(drive())
    assert found.findings == ()
    assert found.figures["noise"]["x"] == pytest.approx(0.001, rel=0.3)
    assert found.figures["parameters"]["gain"]["verdict"] == "identifiable"
    assert abs(found.figures["lag"]["x"].seconds) < 0.05
    assert found.rows == 1500 and "0 findings" in str(found)


def test_a_lag_is_given_with_its_figure() -> None:
    found = Twin(SPEC).doctor(drive(lag=0.3))
    (finding,) = found.of_kind("lag")
    assert finding.evidence["x"]["seconds"] == pytest.approx(0.3, abs=0.03)
    assert "offset" in finding.step and "ms" in finding.reason


def test_positions_that_are_held_are_told() -> None:
    data = drive()
    data["x"] = data["x"][np.arange(1500) // 3 * 3]
    (finding,) = Twin(SPEC).doctor(data).of_kind("held")
    assert finding.subject == "x" and "3.3 Hz" in finding.step and "filter" not in finding.step


def test_a_horizon_within_the_noise() -> None:
    spec = replace(SPEC, prediction=PredictionSpec(horizon=0.1))
    found = Twin(spec).doctor(drive(noise=0.02))
    assert {"horizon", "tolerance", "requirement"} <= set(kinds(found))
    (finding,) = found.of_kind("horizon")
    assert "longer horizon" in finding.step


def test_too_little_data_for_a_trial() -> None:
    (finding,) = Twin(SPEC).doctor(drive(rows=120)).of_kind("horizon")
    assert finding.evidence["segments"] == 11


def test_a_table_whose_steps_are_too_coarse() -> None:
    rule = CorrectionSpec(channels=("v",), terms=("table",), quantum=0.2)
    spec = replace(SPEC, correction=rule)
    data = drive(gain=0.3)
    (finding,) = Twin(spec).doctor(data).of_kind("range")
    assert "quantum" in finding.reason
    proposed = replace(spec, correction=replace(rule, quantum=0.0))
    assert not Twin(proposed).doctor(data).of_kind("range")  # nobody set what would be too coarse


def test_start_on_a_bound_needs_no_data() -> None:
    model = ModelSpec("robot1d", parameters={"gain": ParameterSpec(value=0.2)})
    found = Twin(replace(SPEC, model=model)).doctor()
    assert kinds(found) == ["at_bound"] and found.rows == 0


def tank(unused: bool = False) -> FunctionModel:
    items = [Parameter("area", 1.0, "m^2", low=0.1), Parameter("outflow", 0.1, "m^2/s", low=0.0)]
    if unused:
        items.append(Parameter("colour", 1.0, "1"))

    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        level = x[0] + dt * (u[0] - p[1] * x[0]) / p[0]
        return [level], [level]

    line = Layout.of(level="m")
    return FunctionModel(step, Layout.of(inflow="m^3/s"), line, line, Parameters(tuple(items)))


def filling(rows: int = 400) -> dict[str, Any]:
    rng = np.random.default_rng(2)
    t = 1.0 * np.arange(rows)
    u = 0.05 + 0.04 * np.sign(np.sin(0.05 * t))
    x = np.empty(rows)
    x[0] = 0.5
    for i in range(1, rows):
        x[i] = x[i - 1] + (u[i - 1] - 0.1 * x[i - 1]) / 1.0
    return {"t": t, "inflow": u, "level": x + rng.normal(0, 1e-3, rows)}


def test_a_knob_that_is_not_connected() -> None:
    spec = TwinSpec("tank", ModelSpec("python"), prediction=PredictionSpec(horizon=10.0))
    found = Twin(spec, tank(unused=True)).doctor(filling())
    (finding,) = found.of_kind("not_connected")
    assert finding.subject == "colour"
    assert set(found.figures["parameters"]) == {"area", "outflow"}


def rubbing(x: Any, u: Any, dt: float, p: Any) -> Any:
    return [], [p[0] * u[0]]


@first_of("seed", range(3))
def test_a_knob_that_is_not_connected_stops_no_other(seed: int) -> None:
    items = (Parameter("rub", 1.0, "Ns/m"), Parameter("colour", 1.0, "1"))
    line = translated(FunctionModel(
        rubbing, Layout.of(speed="m/s"), Layout.of(force="N"), parameters=Parameters(items)
    ))  # fmt: skip
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(6000)
    speed = np.sin(t) * np.sin(0.13 * t)
    force = 3.0 * speed + rng.normal(0.0, 0.1, 6000)
    spec = TwinSpec(
        "line", ModelSpec("python"), anomaly=AnomalySpec(requirement=0.05),
        tuning=TuningSpec(causes={"paint": ("colour",)}),
        prediction=PredictionSpec(horizon=1.0),
    )  # fmt: skip
    data = {"t": t, "speed": speed, "force": force}
    found = Twin(spec, line).doctor(data)
    assert found.findings[0].kind == "not_connected"
    result = Twin(spec, line).run(data)
    known = dict(zip(result.champion.names, result.champion.values, strict=True))
    assert [e for e in result.events if e.kind == "promoted"]
    assert known["rub"] == pytest.approx(3.0, rel=0.05)
    assert known["colour"] == 1.0


@pytest.mark.slow
def test_motion_in_one_direction_names_the_missing_motion() -> None:
    axis = FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * np.sign(u[0]) + p[1] + p[2] * u[0]]),
        Layout.of(speed="rad/s"), Layout.of(torque="Nm"),
        parameters=Parameters.of(Fc=(1.0, "Nm"), offset=(0.1, "Nm"), Fv=(1.0, "Nms/rad")),
    )  # fmt: skip
    rng = np.random.default_rng(1)
    t = 0.1 * np.arange(600)
    speed = 1.5 + np.sin(t)
    torque = 1.0 + 0.1 + speed + rng.normal(0, 0.02, 600)
    asked = AnomalySpec(requirement=0.05)
    found = Twin(TwinSpec("axis", ModelSpec("python"), anomaly=asked), axis).doctor(
        {"t": t, "speed": speed, "torque": torque}
    )
    (finding,) = found.findings
    assert finding.kind == "not_identifiable"
    assert finding.evidence["parameters"] == ["Fc", "offset"]
    assert "speed in both directions" in finding.step
    assert found.figures["parameters"]["Fv"]["verdict"] == "identifiable"
    assert found.to_dict()["schema"] == "evertwin.doctor/1"


def test_editable_parameters_come_from_the_twin_file() -> None:
    spec = replace(SPEC, tuning=TuningSpec(editable=("gain",)))
    assert list(Twin(spec).doctor(drive()).figures["parameters"]) == ["gain"]


def test_rows_that_are_not_used_are_counted() -> None:
    data = drive()
    data["v"][200:700] = np.nan
    found = Twin(SPEC).doctor(data)
    # what acted there is unknown, unless the twin file says that a command goes on acting
    assert {"missing", "lost"} <= set(kinds(found))
    held = replace(SPEC, signals={"v": SignalSpec(hold=True)})
    assert "lost" not in kinds(Twin(held).doctor(data))
    data["x"][200:700] = np.inf
    found = Twin(SPEC).doctor(data)
    assert {"absurd", "lost"} <= set(kinds(found))


def test_celsius_taken_for_kelvin() -> None:
    t = 1.0 * np.arange(300)
    data = {"t": t, "heater": (t // 50) % 2, "room": np.full(300, 20.0), "box": 20 + 0.01 * t}
    spec = TwinSpec("box", ModelSpec("thermal"), prediction=PredictionSpec(horizon=20.0))
    found = Twin(spec).doctor(data)
    assert any("degC" in item.step for item in found.of_kind("unit"))


def test_it_shows_itself_in_a_notebook() -> None:
    shown = Twin(SPEC).doctor(drive(lag=0.3))._repr_html_()
    assert "<table>" in shown and "lag" in shown


def test_what_spoils_most_comes_first_and_what_is_alike_stands_together() -> None:
    kinds = ("weak", "gap", "unit", "weak", "lag", "horizon", "at_bound", "tolerance")
    found = tuple(Finding(k, f"{k}{i}", f"reason {i}", "rows", k) for i, k in enumerate(kinds))
    lines = Diagnosis("robot", 10, found, {}).text().splitlines()
    assert [line.split(":")[0] for line in lines[1:11:2]] == [
        "unit", "lag", "gap", "horizon", "tolerance"
    ]  # fmt: skip
    assert lines[-1].startswith("and 3 less important (--all): at_bound (at_bound6); weak (weak0)")
    every = Diagnosis("robot", 10, found, {}).text(len(found))
    assert "weak, 2 times: reason 0 (rows); also weak3" in every


def test_rows_that_are_refused_come_before_changes_that_are_not_told() -> None:
    found = tuple(Finding(k, k, k, "rows", k) for k in ("hidden", "at_bound", "gate"))
    ranked = Diagnosis("robot", 10, found, {}).ranked
    assert [group[0].kind for group in ranked] == ["gate", "at_bound", "hidden"]


def test_starts_of_several_recordings_that_cannot_be_told_are_named() -> None:
    """The lower level is measured, so its start acts on nothing."""
    model = FunctionModel(
        lambda x, u, dt, p: ([x[0] + dt * (u[0] - p[0] * x[0])],) * 2, Layout.of(u="1"),
        Layout.of(y="m"), Layout.of(y="m"),
        Parameters((Parameter("leak", 0.1, "1/s", 0.01, 1.0), Parameter("first", 0.1, "m"))),
        ("first",),
    )  # fmt: skip
    rng, t = np.random.default_rng(1), 0.1 * np.arange(400)
    u = np.repeat(rng.uniform(0.0, 1.0, 10), 40)
    y = 0.1 + np.concatenate([[0.0], np.cumsum(0.1 * (u[:-1] - 0.1))])
    rows = [
        make_block(
            t=np.int64(1e9 * (t + 100.0 * k)), u=u[:, None], y=y[:, None], row=400 * k, task=k
        )
        for k in range(2)
    ]
    with Twin(TwinSpec("tank", ModelSpec("given"), prediction=PredictionSpec(2.0)), model) as twin:
        found = twin.doctor(rows).of_kind("not_identifiable")
    assert any("first of recording 2" in str(one) for one in found)


def stirring(x: Any, u: Any, dt: float, p: Any) -> Any:
    return [], [p[0] * u[0] + p[1] * u[0] * abs(u[0]) * np.sin(u[1])]


@pytest.mark.parametrize(("spread", "shared"), [(0.1, True), (2.0, False)])
@pytest.mark.parametrize("seed", range(3))
def test_a_wear_that_another_parameter_hides_is_told(
    spread: float, shared: bool, seed: int
) -> None:
    """Speeds that hardly differ do not tell viscous friction from that of the square."""
    axis = translated(FunctionModel(
        stirring, Layout.of(speed="rad/s", angle="rad"), Layout.of(torque="Nm"),
        parameters=Parameters.of(Fv=(1.0, "Nms/rad"), Fq=(1.0, "1")),
    ))  # fmt: skip
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(600)
    speed = rng.uniform(2.0, 2.5, 600)
    angle = np.pi / 2 + rng.normal(0.0, spread, 600)
    torque = speed + speed**2 * np.sin(angle) + rng.normal(0.0, 0.02, 600)
    wear = IndicatorSpec(name="friction", parameter="Fv", limit=2.0)
    found = Twin(TwinSpec("axis", ModelSpec("python"), indicator=(wear,)), axis).doctor(
        {"t": t, "speed": speed, "angle": angle, "torque": torque}
    )
    told = found.of_kind("shared")
    assert bool(told) is shared
    if told:
        assert "Fv tells the wear of friction, and Fq, tuned with it" in told[0].reason
