"""Parameters that are followed in the stream: predict first, then learn."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import (
    AnomalySpec,
    ClockSpec,
    ModelSpec,
    MovingSpec,
    PredictionSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.errors import ConfigError
from evertwin.machines.arm import Arm
from evertwin.twin import Twin

RATE = 50.0
FRICTION = ("Fv*", "Fc*")
SPEC = TwinSpec(
    "arm",
    ModelSpec("arm", {"urdf": "ur5_like", "law": "tanh"}),
    clock=ClockSpec(rate=RATE),
    moving=MovingSpec(above=0.05, channels={f"tau{k}": f"qd{k}" for k in range(1, 7)}),
    prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.02, window=Span(400)),
    tuning=TuningSpec(editable=FRICTION, window=Span(2000)),
)


def motion(seed: int, rows: int) -> np.ndarray:
    """Joint motion (rows, 18): sums of two sines per joint."""
    rng, t = np.random.default_rng(seed), np.arange(rows) / RATE
    q = np.zeros((3, rows, 6))
    for joint in range(6):
        for pulse in rng.uniform(0.5, 2.0, 2):
            phase = rng.uniform(0, 6)
            q[0, :, joint] += 0.4 * np.sin(pulse * t + phase)
            q[1, :, joint] += 0.4 * pulse * np.cos(pulse * t + phase)
            q[2, :, joint] -= 0.4 * pulse**2 * np.sin(pulse * t + phase)
    return np.concatenate(q, axis=1)


def recording(seed: int, friction: float, rows: int = 2000) -> dict[str, Any]:
    """Columns of an arm with so much friction [Nm and Nms/rad] and 0.05 Nm of noise."""
    arm = Arm.of("ur5_like", law="tanh")
    values = {f"Fc{k}": friction for k in range(1, 7)} | {f"Fv{k}": friction for k in range(1, 7)}
    u = motion(seed, rows)
    p = arm.parameters.with_values(values).values
    _, tau = arm.simulate(np.zeros(0), u, np.full(rows, 1 / RATE), p)
    tau += np.random.default_rng(seed).normal(0, 0.05, tau.shape)
    names = [f"{kind}{k}" for kind in ("q", "qd", "qdd") for k in range(1, 7)]
    columns: dict[str, Any] = {"t": np.arange(rows) / RATE}
    columns |= {name: u[:, k] for k, name in enumerate(names)}
    return columns | {f"tau{k + 1}": tau[:, k] for k in range(6)}


def deviation(method: Any) -> list[float]:
    """Moving deviation per joint on a day with 15 % more friction than the fit knew."""
    spec = replace(SPEC, tuning=replace(SPEC.tuning, method=method))
    result = Twin(spec).fit(recording(1, 4.0), [recording(2, 4.6)])
    return [one.relative_rms_moving for one in result.test]


def test_friction_that_has_grown_is_followed() -> None:
    fixed, followed = np.array(deviation("auto")), np.array(deviation("recursive"))
    assert (followed[3:] < 0.6 * fixed[3:]).all(), (fixed, followed)
    assert (followed <= 1.05 * fixed).all()


def test_a_run_takes_the_newest_estimate() -> None:
    spec = replace(SPEC, tuning=replace(SPEC.tuning, method="recursive"))
    result = Twin(spec).run(recording(3, 4.0, 6000))
    assert result.of_kind("promoted")
    found = [result.parameters[f"Fc{k}"].value for k in range(1, 7)]
    assert np.allclose(found, 4.0, rtol=0.1)


def test_what_is_not_linear_cannot_be_followed() -> None:
    spec = TwinSpec(
        "robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
        tuning=TuningSpec(method="recursive"),
    )  # fmt: skip
    t = np.arange(100) * 0.1
    data = {"t": t, "v": np.full(100, 0.2), "x": 0.2 * t}
    with pytest.raises(ConfigError, match="expected outputs that are linear"):
        Twin(spec).fit(data, [data])


def test_a_wrong_form_that_may_not_be_corrected_is_tuned_all_the_same() -> None:
    law = {"urdf": "ur5_like", "law": "sign"}
    spec = replace(SPEC, model=ModelSpec("arm", law))
    result = Twin(spec).run(recording(5, 4.0, 4000))
    assert "abnormal" in {event.kind for event in result.events}
    assert result.champion.number > 0
    worst = max(f.relative_rms_after for f in result.outputs.values())
    before = max(f.relative_rms_before for f in result.outputs.values())
    assert worst < 0.5 * before
