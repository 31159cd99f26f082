"""A static map whose numbers nobody stated: what a mass takes up is no unit, and no lag."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import ModelSpec, MovingSpec
from evertwin.doctor import Diagnosis
from evertwin.models.spec import ParameterSpec

RATE = 200


def examined(sign: float = 1.0, late: float = 0.0) -> Diagnosis:
    """An axis of 50 kg, of which the twin believes 1 kg; what its force sensor does."""
    t = np.arange(30 * RATE) / RATE
    v = 0.3 * np.sin(1.3 * t) + 0.2 * np.sin(3.1 * t)
    a = np.gradient(v, t)
    force = 50.0 * a + 100.0 * v + 20.0 * np.tanh(v / 0.003)
    force = sign * np.interp(t - late, t, force)
    noise = np.random.default_rng(0).normal(0.0, 0.8, len(t))
    spec = TwinSpec(
        "axis", ModelSpec("drive_force", {"law": "sign"}),
        moving=MovingSpec(above=0.01, channels={"force": "speed"}),
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.doctor({"t": t, "speed": v, "acceleration": a, "force": force + noise})


def told(found: Diagnosis) -> list[str]:
    return [one.kind for one in found.findings if one.kind in ("unit", "sign", "lag")]


def test_a_mass_that_nobody_stated_is_no_unit_and_no_lag() -> None:
    assert told(examined()) == []


def test_a_turned_sign_is_told_whatever_the_numbers() -> None:
    found = examined(sign=-1.0)
    assert told(found) == ["sign"]
    (one,) = (one for one in found.findings if one.kind == "sign")
    assert "force times -1" in one.reason


@pytest.mark.parametrize("late", [0.02, 0.05])
def test_a_lag_is_not_taken_up_by_the_numbers(late: float) -> None:
    found = examined(late=late)
    assert told(found) == ["lag"]
    (one,) = (one for one in found.findings if one.kind == "lag")
    assert one.evidence["force"]["seconds"] == pytest.approx(late, abs=0.005)


def lifted(sign: float) -> list[str]:
    """A lift whose load pulls all the time, and which hangs far from where its angle is zero; its
    law has terms that no moving row tells apart."""
    t = np.arange(3000) / 100
    v = 3.0 * np.sin(1.3 * t) + 2.0 * np.sin(3.1 * t)
    a, angle = np.gradient(v, t), 20.0 + np.cumsum(v) / 100
    torque = sign * (0.3 * a + 0.3 * v + 2.0 * np.tanh(v / 0.03) + 25.0)
    noise = np.random.default_rng(0).normal(0.0, 0.2, len(t))
    spec = TwinSpec(
        "lift", ModelSpec("drive_force", {"law": "sign+two_sided+spring", "rotary": True}),
        moving=MovingSpec(above=0.1, channels={"torque": "speed"}, tune=True),
    )  # fmt: skip
    columns = {"t": t, "speed": v, "acceleration": a, "position": angle, "torque": torque + noise}
    with Twin(spec) as twin:
        return told(twin.doctor(columns))


def test_a_load_that_pulls_all_the_time_is_no_turned_sensor() -> None:
    assert lifted(1.0) == []


def test_a_load_that_pulls_all_the_time_hides_no_turned_sensor() -> None:
    assert lifted(-1.0) == ["sign"]


def factors(seed: int, values: dict[str, float], times: float = 1.0) -> list[str]:
    """An axis that rubs, and its force times a number for the last quarter of the recording."""
    rng, t = np.random.default_rng(seed), np.arange(4000) / 100
    waves = (rng.normal() / n * np.sin(0.5 * n * t + rng.uniform(0, 6)) for n in range(1, 7))
    v = sum(waves) * np.clip(t - 2.0, 0.0, 1.0)
    a = np.gradient(v, t)
    force = 14.0 * a + 60.0 * v + 55.0 * np.tanh(v / 0.003) + rng.normal(0.0, 1.0, len(t))
    force[3000:] *= times
    given = {name: ParameterSpec(value=value) for name, value in values.items()}
    spec = TwinSpec(
        "axis", ModelSpec("drive_force", {"law": "tanh"}, parameters=given),
        moving=MovingSpec(above=0.05, channels={"force": "speed"}),
    )  # fmt: skip
    with Twin(spec) as twin:
        found = twin.doctor({"t": t, "speed": v, "acceleration": a, "force": force})
    return [one.reason for one in found.findings if "off by a factor" in one.reason]


def test_an_untuned_model_says_nothing_of_a_sensor() -> None:
    assert not any(factors(seed, {"mass": 3.0}) for seed in range(12))


def test_a_factor_is_told_by_a_model_that_fits() -> None:
    known = {"mass": 14.0, "Fv": 60.0, "Fc": 55.0}
    assert all(factors(seed, known, 10.0) for seed in range(3))
