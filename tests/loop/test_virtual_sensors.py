"""Quantities inside components, read while the twin runs: outputs that nothing measures."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.config import spec as config
from evertwin.errors import ConfigError
from evertwin.machines.assembly import assembly
from evertwin.twin import Twin

SHOWN = ("motor.current", "screw.friction")
LINES = (
    {"name": "motor", "kind": "motor", "axis": 1, "k": 0.5},
    {"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.02, "Fc": 10.0, "Fv": 30.0},
    {"name": "table", "kind": "mass", "axis": 1, "mass": 50.0},
)


def recorded() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    t = np.arange(8000) * 0.01
    v, a = 0.3 * np.sin(2 * t) + 0.1 * np.sin(5 * t), 0.6 * np.cos(2 * t) + 0.5 * np.cos(5 * t)
    model = assembly(LINES)
    truth = model.parameters.with_values({"screw.Fc": 20.0}).values
    force = model.simulate(np.zeros(0), np.column_stack([v, a]), np.full(8000, 0.01), truth)[1][
        :, 0
    ]
    return {"t": t, "qd1": v, "qdd1": a, "tau1": force + rng.normal(0, 0.3, 8000)}


def twin_of(measured: bool) -> Twin:
    options = {"components": LINES, "sensors": SHOWN}
    return Twin(
        config.TwinSpec(
            "axis",
            config.ModelSpec("assembly", options),
            signals={name: config.SignalSpec(measured=measured) for name in SHOWN},
            moving=config.MovingSpec(above=0.05, channels={"tau1": "qd1"}),
            anomaly=config.AnomalySpec(requirement=0.05, window=config.Span(500)),
            tuning=config.TuningSpec(editable=("screw.Fc",), window=config.Span(500)),
            beat=config.Span(100),
        )
    )


def test_virtual_sensors_run_beside_what_is_measured() -> None:
    data = recorded()
    with twin_of(measured=False) as twin:
        result = twin.run(data)
        fit = twin.fit(data)
    assert result.champion.number > 0
    assert fit.fit["screw.Fc"] == pytest.approx(20.0, abs=0.1)
    assert "motor.current" not in str(result) and "motor.current" not in str(fit).split("train:")[1]
    rows = result.to_pandas()
    column = next(name for name in rows.columns if "screw.friction" in name and "pred" in name)
    moving = np.abs(data["qd1"][-200:]) > 0.1
    # the newest champion knows the friction that nobody measured
    expected = 20.0 * np.sign(data["qd1"][-200:]) + 30.0 * data["qd1"][-200:]
    shown = rows[column].to_numpy()[-200:]
    assert shown[moving] == pytest.approx(expected[moving], abs=0.5)


def test_a_sensor_that_should_be_recorded_and_is_not_is_an_error() -> None:
    with twin_of(measured=True) as twin, pytest.raises(ConfigError, match="neither recorded"):
        twin.run(recorded())


def test_the_twin_climbs_to_the_temperature_only_where_it_pays() -> None:
    guide = {"name": "guide", "kind": "guide", "axis": 1, "temperature": "input", "Fc": 20.0}
    lines = (guide, {"name": "table", "kind": "mass", "axis": 1, "mass": 50.0})
    model, rng = assembly(lines), np.random.default_rng(2)
    t = np.arange(4000) * 0.05
    v = 0.3 * np.sin(t) + 0.1 * np.sin(3.1 * t)
    a, warm = np.gradient(v, t), 303.15 - 10 * np.cos(2 * np.pi * t / 40)
    spec = config.TwinSpec(
        "axis",
        config.ModelSpec("assembly", {"components": lines}),
        tuning=config.TuningSpec(
            editable=("guide.Fv*", "guide.Fc*"), ladder=("temperature",), window=config.Span(4000)
        ),
    )
    for change, law in ((-0.2, "tanh+temperature"), (0.0, "tanh")):
        p = model.parameters.with_values({"guide.Fc_T": change, "guide.Fv": 50.0}).values
        u = np.column_stack([v, a, warm])
        y = model.simulate(np.zeros(0), u, np.full(4000, 0.05), p)[1][:, 0]
        data = {"t": t, "qd1": v, "qdd1": a, "guide.T": warm, "tau1": y + rng.normal(0, 0.5, 4000)}
        with Twin(spec) as twin:
            assert twin.fit(data).laws == {"table": law}
