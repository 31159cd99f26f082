"""Scenarios: each change does what physics says, mistakes are named with their line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.simulated import Exceeded, OutputSize, Simulated
from evertwin.ahead.spec import SCENARIO, ScenarioSpec, read_scenario
from evertwin.ahead.whatif import WhatIf
from evertwin.config import spec
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.settings.schema import schema
from evertwin.sync.spec import DeriveSpec
from planted.draws import first_of


def arm(**more: object) -> Twin:
    options = {"urdf": "ur5_like", "law": "sign", **more}
    return Twin(TwinSpec("arm", spec.ModelSpec("arm", options)))


def motion(twin: Twin, seconds: float = 10.0, seed: int = 0) -> dict[str, np.ndarray]:
    """A smooth motion at 20 Hz with the model's torques and noise of 0.1 Nm."""
    t = np.arange(0.0, seconds, 0.05)
    w = np.arange(1, 7) * 0.3
    q, qd, qdd = (
        np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w)), -(w**2) * np.sin(np.outer(t, w)),
    )  # fmt: skip
    u = np.concatenate([q, qd, qdd], axis=1)
    p = twin.champion.p
    _, tau = twin.model.simulate(np.zeros(0), u, np.full(len(t), 0.05), p)
    tau = tau + np.random.default_rng(seed).normal(0.0, 0.1, tau.shape)
    columns = {"t": t}
    names = (*twin.model.inputs.names, *twin.model.outputs.names)
    return columns | dict(zip(names, np.concatenate([u, tau], axis=1).T, strict=True))


def told(text: str) -> ScenarioSpec:
    return SCENARIO.parse(f'schema = 1\nname = "s"\n{text}', "s.toml")


def test_inertial_torques_grow_with_the_square_of_the_speed() -> None:
    twin = arm(gravity=(0.0, 0.0, 0.0))
    found = twin.whatif(told("[speed]\nfactor = 2.0"), motion(twin))
    assert found.after.seconds == pytest.approx(found.before.seconds / 2)
    for name, size in found.after.outputs.items():
        assert size.rms == pytest.approx(4.0 * found.before.outputs[name].rms, rel=1e-9)


def test_a_load_at_rest_is_its_weight_times_its_arm() -> None:
    twin = arm()
    still = {name: np.zeros(40) for name in (*twin.model.inputs.names, *twin.model.outputs.names)}
    rng = np.random.default_rng(1)
    still |= {f"tau{j}": rng.normal(0.0, 0.1, 40) for j in range(1, 7)}
    still["t"] = np.arange(40) * 0.1
    one, two = (twin.whatif(told(f'[load]\nmass = "{m} kg"'), still).after.y[0] for m in (1.0, 3.0))
    none = twin.whatif(told("horizon = 2"), still).after.y[0]
    assert two - none == pytest.approx(3.0 * (one - none), rel=1e-9)
    assert abs(one - none).max() > 1.0


def test_a_worn_parameter_and_a_new_component() -> None:
    twin = arm()
    rows = motion(twin)
    worn = twin.whatif(told("[parameters]\nFc1 = { add = 3.0 }"), rows)
    more = worn.after.y[:, 0] - worn.before.y[:, 0]
    assert np.unique(np.abs(more).round(9)).tolist() == [3.0]
    assert worn.after.work["tau1"] > worn.before.work["tau1"]
    new = twin.whatif(told("[components.gearbox1]\nFc1 = 2.0"), rows)
    assert np.abs(new.after.y[:, 0] - new.before.y[:, 0]).max() == pytest.approx(2.0)
    with pytest.raises(UsageError, match="parameters of 'gearbox9' are not known"):
        twin.whatif(told("[components.gearbox9]"), rows)


def test_limits_are_told_before_the_machine_runs_a_path() -> None:
    twin = arm()
    rows = motion(twin)
    path = '[path]\nmoves = [{ move = "joints", to = [1, 0, 0, 0, 0, 0] }]\n'
    path += "start = [0, 0, 0, 0, 0, 0]\n[limits]\n"
    found = twin.whatif(told(path + "tau2 = 1.0"), rows)
    assert {one.channel for one in found.after.exceeded} == {"tau2"}
    assert any("tau2 reaches" in said for said in found.findings)
    size = found.after.outputs["tau2"]
    assert size.chance == pytest.approx(1.0) and size.peak95[0] <= size.peak
    # the largest of many rows with noise of 0.1 Nm lies some of its sizes above the largest without
    assert 0.1 < size.peak95[1] - size.peak < 0.6
    # all of them lie above it: 95 % of them from there on
    top = twin.whatif(told(path + f"tau2 = {size.peak95[1]}"), rows).after.outputs["tau2"]
    assert size.peak95[0] == size.peak and top.chance == pytest.approx(0.05, abs=0.01)
    fast = told("[speed]\nfactor = 10")
    assert any(one.channel == "qd6" for one in twin.whatif(fast, rows).after.exceeded)


def test_path_errors_of_a_mobile_robot_are_distances(tmp_path: Path) -> None:
    """Planned on the commands; the live version drives 10 % too fast."""
    gain = {"gain": spec.ParameterSpec(value=1.1)}
    twin = Twin(TwinSpec("base", spec.ModelSpec("differential", parameters=gain)))
    t = np.arange(0.0, 60.0, 0.5)
    rng = np.random.default_rng(2)
    x = 1.1 * 0.1 * t
    noise = rng.normal(0.0, 1e-3, (3, len(t)))
    rows = {"t": t, "v": np.full(len(t), 0.1), "w": np.zeros(len(t)), "x": x + noise[0],
            "y": noise[1], "heading": 0.1 * noise[2]}  # fmt: skip
    path = tmp_path / "path.csv"
    end = float(rows["x"][-1])
    lines = [f"{0.5 * k},0.1,0,{end + 0.05 * (k + 1)},0" for k in range(40)]
    path.write_text("t,v,w,x,y\n" + "\n".join(lines))
    (tmp_path / "s.toml").write_text(
        'schema = 1\nname = "new path"\nhorizon = "0.5 s"\n[path]\nfile = "path.csv"\n'
    )
    found = twin.whatif(read_scenario(tmp_path / "s.toml"), rows)
    error = found.after.path_error["position"]
    assert error.end == pytest.approx(0.1 * 2.0, abs=0.01) and error.largest >= error.rms
    assert error.end95[0] < error.end < error.end95[1]


def test_mistakes_are_named_with_their_line() -> None:
    with pytest.raises(ConfigError, match=r"s\.toml:4: .*did you mean 'factor'"):
        told("[speed]\nfaktor = 1.2\nfactor = 1.0")
    with pytest.raises(ConfigError, match=r"s\.toml:4: .*above 0"):
        told("[speed]\nfactor = -1.0")
    with pytest.raises(ConfigError, match="either a file or moves"):
        told("[path]\nrate = 50")
    with pytest.raises(ConfigError, match="one of value, factor or add"):
        told("[parameters]\nFc1 = { factor = 2, add = 1 }")
    content = schema(SCENARIO)
    assert content["additionalProperties"] is False


def test_changes_that_a_machine_cannot_have_are_refused(tmp_path: Path) -> None:
    robot = Twin(TwinSpec("robot", spec.ModelSpec("robot1d")))
    t = np.arange(200.0)
    x = 0.1 * t + np.random.default_rng(0).normal(0.0, 0.01, 200)
    rows = {"t": t, "v": np.full(200, 0.1), "x": x}
    with pytest.raises(UsageError, match="carries no payload"):
        robot.whatif(told("[load]\nmass = 1"), rows)
    with pytest.raises(UsageError, match="did you mean 'gain'"):
        robot.whatif(told("[parameters]\ngian = 1"), rows)
    with pytest.raises(UsageError, match="outside"):
        robot.whatif(told("[parameters]\ngain = 50"), rows)
    with pytest.raises(UsageError, match="for another machine give a file"):
        robot.whatif(told('[path]\nmoves = [{ move = "pause", seconds = 1 }]'), rows)
    with pytest.raises(DataError, match=r"absent\.csv: cannot be read"):
        robot.whatif(told('path = "absent.csv"'), rows)
    with pytest.raises(UsageError, match="wear: no"):
        robot.whatif(told("wear = 10"), rows)
    box = Twin(TwinSpec("box", spec.ModelSpec("drive")))
    n = 400
    rest = {name: np.zeros(n) for name in (*box.model.inputs.names, *box.model.outputs.names)}
    rest[box.model.outputs.names[0]] = np.random.default_rng(1).normal(0.0, 1e-3, n)
    with pytest.raises(UsageError, match="is no motion"):
        box.whatif(told("[speed]\nfactor = 2"), rest | {"t": np.arange(n) * 0.01})


def test_the_rms_that_will_be_measured_has_the_width_of_what_predictions_miss() -> None:
    twin = arm()
    found = twin.whatif(told("[speed]\nfactor = 0.9"), motion(twin))
    for size in found.after.outputs.values():
        low, high = size.rms95
        assert low <= size.rms <= high and 0.0 < high - low < size.peak95[1] - size.peak95[0]


def test_temperatures_are_told_in_the_unit_of_their_source() -> None:
    def case(peak: float, over: bool) -> Simulated:
        limit, chance = 313.15, 1.0
        size = OutputSize("K", 300.0, (299.0, 301.0), peak, (peak - 1, peak + 40), limit, chance)
        found = (Exceeded("box", "K", peak, limit, 7.0),) if over else ()
        return Simulated(9.0, {"box": size}, found)

    both = WhatIf("oven", "hot", 1, case(318.15, True), case(323.15, True),
                  recorded={"box": "degC"})  # fmt: skip
    assert both.findings == (
        "box reaches 50 degC at 7 s, limit 40 degC (the baseline passes it too)",
    )
    assert "peak        45 ->        50 (49 … 90)" in str(both) and "rms" not in str(both)
    assert both.to_dict()["change"] == {}
    below = WhatIf("oven", "hot", 1, Simulated(9.0, {}), case(308.15, False),
                   recorded={"box": "degC"})  # fmt: skip
    assert below.findings == (
        "box stays at 35 degC in the simulation; with what predictions are off by it passes its "
        "limit 40 degC (probability 1)",
    )


def test_a_version_that_does_not_fit_is_said_in_one_line() -> None:
    asks = spec.AnomalySpec(requirement=1.0, relative=False)
    twin, off = (
        Twin(replace(arm().spec, model=replace(arm().spec.model, parameters=more), anomaly=asks))
        for more in ({}, {"Fc1": spec.ParameterSpec(value=19.0)})
    )
    rows = motion(twin)
    asked = "[parameters]\nFc1 = { add = 3.0 }"
    assert not twin.whatif(told(asked), rows).notes
    (note,) = off.whatif(told(asked), rows).notes
    assert note.startswith("version 0 was never tuned and does not fit these recordings: tau1 is")


def axis_rows(seed: int, rows: int = 3000) -> dict[str, np.ndarray]:
    """An axis that stands half of the time; a filter takes out the noise of its force."""
    rng, t = np.random.default_rng(seed), np.arange(rows) * 0.01
    moves = (t // 5.0) % 2 == 0
    speed = np.where(moves, 0.5 * np.sin(2 * np.pi * 0.2 * t), 0.0)
    acceleration = np.where(moves, 0.2 * np.pi * np.cos(2 * np.pi * 0.2 * t), 0.0)
    force = 100.0 * acceleration + 40.0 * speed + 20.0 * np.sign(speed)
    return {"t": t, "speed": speed, "acceleration": acceleration,
            "force": force + rng.normal(0.0, 5.0, rows)}  # fmt: skip


def axis(mass: float = 100.0) -> Twin:
    values = {"mass": mass, "Fv": 40.0, "Fc": 20.0}
    return Twin(
        TwinSpec(
            "axis",
            spec.ModelSpec(
                "drive_force",
                parameters={name: spec.ParameterSpec(value=one) for name, one in values.items()},
            ),
            clock=spec.ClockSpec(rate=100.0), filter=spec.FilterSpec(cutoff=5.0),
            moving=spec.MovingSpec(above=0.01, channels={"force": "speed"}),
            anomaly=spec.AnomalySpec(requirement=0.05),
        )
    )  # fmt: skip


@first_of("seed", range(3))
def test_one_deviation_everywhere(seed: int) -> None:
    rows = axis_rows(seed)
    assert not axis().whatif(told(""), rows).notes
    off = axis(120.0)
    (note,) = off.whatif(told(""), rows).notes
    (same,) = off.compare(0, 0, rows).deviations[0]
    assert f"force is off by {100 * same.relative_rms_moving:.1f} %" in note


def test_the_friction_of_a_drive_works_and_a_faster_motion_is_beyond() -> None:
    twin, rows = axis(), axis_rows(0)
    found = twin.whatif(told("[speed]\nfactor = 20"), rows)
    v, dt = np.abs(rows["speed"]), 0.01
    wanted = float(np.sum(v * (40.0 * v + 20.0)) * dt)
    assert found.before.work["force"] == pytest.approx(wanted, rel=0.01)
    faster = float(np.sum(20 * v * (800.0 * v + 20.0)) * dt / 20)
    assert found.after.work["force"] == pytest.approx(faster, rel=0.01)
    assert any("beyond what was recorded" in one and "speed -10 … 10" in one for one in found.notes)


@first_of("seeds", [range(8), range(20)])
def test_what_a_form_lacks_is_in_the_band_of_a_static_map(seeds: range) -> None:
    """The model knows no drag that grows with the square of the speed; noise averages out, that
    does not."""
    inside = 0
    for seed in seeds:
        rng, rows = np.random.default_rng(seed), axis_rows(seed)
        v, factor = rows["speed"], float(rng.uniform(0.7, 1.3))
        drag = rng.uniform(-12.0, 12.0)
        rows["force"] = rows["force"] + drag * v * np.abs(v)
        out = axis().whatif(told(f"[speed]\nfactor = {factor}"), rows).after.outputs["force"]
        w, a = factor * v, factor**2 * rows["acceleration"]
        force = 100.0 * a + 40.0 * w + 20.0 * np.sign(w) + drag * w * np.abs(w)
        rms = float(np.sqrt(np.mean((force + rng.normal(0.0, 5.0, len(force))) ** 2)))
        inside += out.rms95[0] <= rms <= out.rms95[1]
    assert inside >= 0.85 * len(seeds)


def test_the_noise_of_a_derived_acceleration_is_no_peak() -> None:
    """The peak that is told is that of the motion, and faster motion has no more noise."""
    t, w = np.arange(3000) * 0.01, 2 * np.pi * 0.2
    v, a = 0.5 * np.sin(w * t), 0.5 * w * np.cos(w * t)
    rng = np.random.default_rng(3)
    force = 100.0 * a + 40.0 * v + 20.0 * np.sign(v) + rng.normal(0.0, 5.0, len(t))
    rows = {"t": t, "speed": v + rng.normal(0.0, 1e-3, len(t)), "force": force}
    derive = (DeriveSpec(name="acceleration", op="derivative", source=("speed",)),)
    twin = Twin(replace(axis().spec, derive=derive))
    out = twin.whatif(told("[speed]\nfactor = 1.5"), rows).after.outputs["force"]
    free = 100.0 * 2.25 * a + 40.0 * 1.5 * v + 20.0 * np.sign(v)
    assert out.peak == pytest.approx(float(np.abs(free).max()), rel=0.02)
