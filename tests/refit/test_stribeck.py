"""The speeds inside a Stribeck law are found, and what the rows leave open of them is carried."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FitResult, Twin, TwinSpec
from evertwin.config import spec as config
from evertwin.models.spec import ParameterSpec

RATE, SEEDS = 100, 12


def axis(seed: int) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """A drawn axis whose friction is the documented form, seen through a low-pass filter."""
    rng = np.random.default_rng([37, seed])
    t = np.arange(40 * RATE) / RATE
    waves = [(rng.normal() / n, 0.08 * n, rng.uniform(0.0, 6.28)) for n in range(1, 7)]
    q = sum(a * np.sin(2 * np.pi * f * t + phase) for a, f, phase in waves)
    q *= 1.2 / np.abs(q).max()
    v = np.gradient(q, t)
    a = np.gradient(v, t)
    true = {
        "mass": rng.uniform(5.0, 20.0), "Fv": rng.uniform(20.0, 60.0),
        "Fc": rng.uniform(20.0, 60.0), "offset": rng.uniform(-5.0, 5.0),
        "vs": rng.uniform(0.06, 0.15), "width": 10 ** rng.uniform(-3.0, -1.7),
    }  # fmt: skip
    true["Fs"] = true["Fc"] * rng.uniform(0.15, 0.4)
    step = np.tanh(v / true["width"]) * (true["Fc"] + true["Fs"] * np.exp(-((v / true["vs"]) ** 2)))
    force = true["mass"] * a + true["Fv"] * v + true["offset"] + step
    force += rng.normal(0.0, 0.01 * true["Fc"], len(t))
    return {"t": t, "speed": v, "acceleration": a, "force": force}, true


def fitted(seed: int, **said: float) -> tuple[FitResult, dict[str, float]]:
    columns, true = axis(seed)
    given = {name: ParameterSpec(value=true[name]) for name in said}
    spec = TwinSpec(
        "axis", config.ModelSpec("drive_force", {"law": "tanh+stribeck+root"}, parameters=given),
        clock=config.ClockSpec(rate=RATE), filter=config.FilterSpec(cutoff=5.0),
        moving=config.MovingSpec(above=0.05, channels={"force": "speed"}, tune=True),
        anomaly=config.AnomalySpec(requirement=0.05),
        tuning=config.TuningSpec(
            editable=("mass", "Fv", "Fc", "offset", "Fs", "Fr"), ladder=("stribeck", "root")
        ),
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.fit(columns), true


def test_what_is_called_identifiable_of_a_stribeck_law_holds() -> None:
    held, told = list[bool](), list[str]()
    for seed in range(SEEDS):
        result, true = fitted(seed)
        for name in set(result.fit.identifiable) & set(true):
            low, high = result.fit.interval(name)
            held.append(low <= true[name] <= high)
            told.append(name)
    assert np.mean(held) >= 0.9
    assert told.count("Fs") >= SEEDS / 2
    assert told.count("vs") >= SEEDS / 2


def test_the_form_of_a_law_that_is_right_is_not_refused() -> None:
    wrong = [s for s in range(SEEDS) if "form of force" in str(fitted(s)[0].fit)]
    assert len(wrong) <= SEEDS / 4


def test_a_speed_that_is_said_stays() -> None:
    result, true = fitted(0, width=1.0)
    assert result.parameters["width"].value == pytest.approx(true["width"])
    assert "width" not in result.fit.names
