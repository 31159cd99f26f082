"""A heading that is counted from elsewhere, or as a compass does, is named, and not learned."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import CorrectionSpec, ModelSpec, PredictionSpec, Span
from planted.draws import first_of

ROWS = 2000


def drive(seed: int) -> tuple[np.ndarray, ...]:
    """A base of its own gains, lags, slip and noise, whose wheels stand a little askew."""
    rng, dt = np.random.default_rng(seed), 0.05
    v, w = (np.repeat(rng.uniform(a, b, ROWS // 40), 40) for a, b in ((-0.3, 0.8), (-0.8, 0.8)))
    gains, lags = rng.uniform(0.6, 1.4, 2), rng.uniform(0.02, 0.2, 2)
    slip, askew = rng.uniform(0.0, 0.25), rng.normal(0.0, 0.02)
    x, y, heading = rng.uniform(-3.0, 3.0, 3)
    speeds, poses = np.zeros(2), np.empty((ROWS, 3))
    for k in range(ROWS):
        poses[k] = x, y, heading
        asked = gains * (v[k] * (1.0 - slip * abs(w[k])), w[k])
        speeds += (asked - speeds) * np.minimum(1.0, dt / lags)
        x += speeds[0] * math.cos(heading + askew) * dt
        y += speeds[0] * math.sin(heading + askew) * dt
        heading += speeds[1] * dt
    noise = rng.normal(0.0, 0.004, (ROWS, 3))
    return dt * np.arange(ROWS), v, w, *(poses + noise).T


def twin() -> Twin:
    spec: dict[str, Any] = {
        "beat": Span(seconds=2.0), "prediction": PredictionSpec(1.0),
        "anomaly": AnomalySpec(requirement=0.02, relative=False, window=Span(seconds=20.0)),
        "correction": CorrectionSpec(channels=("v", "w"), terms=("lag", "law", "table")),
    }  # fmt: skip
    return Twin(TwinSpec("base", ModelSpec("differential"), **spec))


def recording(seed: int, sign: float, zero: float) -> dict[str, np.ndarray]:
    t, v, w, x, y, heading = drive(seed)
    read = np.remainder(sign * heading + zero, 2.0 * math.pi)
    return {"t": t, "v": v, "w": w, "x": x, "y": y, "heading": read}


@first_of("seed", range(6))
def test_a_heading_that_is_right_is_no_finding(seed: int) -> None:
    data = recording(seed, 1.0, 0.0)
    with twin() as one:
        assert not [found for found in one.doctor(data).findings if found.kind == "turned"]
        assert not one.fit(data).doubt


@first_of("seed", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_heading_of_another_zero_is_named(seed: int, sign: float) -> None:
    zero = math.radians((35.0, 45.0, 90.0, 135.0, -60.0, -100.0)[seed])
    data = recording(seed, sign, zero)
    with twin() as one:
        told = [found for found in one.doctor(data).findings if found.kind == "turned"]
        fit = one.fit(data)
    assert [found.subject for found in told] == ["heading"]
    shift = told[0].evidence["shift"]
    assert told[0].evidence["number"] == sign
    assert abs(math.remainder(sign * zero + shift, 2.0 * math.pi)) < 0.1
    assert fit.doubt in str(fit).splitlines()[0] and "heading" in fit.doubt
    assert ("scale = -1" in fit.doubt) == (sign < 0.0)


@first_of(("sign", "zero"), [(-1.0, math.pi / 2), (1.0, 1.2)])
def test_nothing_is_learned_from_it(sign: float, zero: float) -> None:
    with twin() as one:
        result = one.run(recording(11, sign, zero))
        assert [event.signal for event in result.of_kind("abnormal")] == ["heading"]
        assert not result.of_kind("promoted") and one.champion.number == 0
        assert "heading" in str(result).splitlines()[0] and "offset = " in str(result)


def test_read_as_it_says_the_base_is_learned() -> None:
    """The step that is told mends it."""
    data = recording(11, -1.0, math.pi / 2)
    with twin() as one:
        found = one.doctor(data).findings[0].evidence
    data["heading"] = found["number"] * data["heading"] + found["shift"]
    with twin() as one:
        assert one.run(data).of_kind("promoted")


def test_a_zero_that_nothing_goes_by_is_nobody_s_fault() -> None:
    """A base that stands tells nothing of where it would go."""
    t, v, w, *_ = drive(3)
    rng = np.random.default_rng(0)
    still = {name: 1.0 + rng.normal(0.0, 0.003, ROWS) for name in ("x", "y", "heading")}
    with twin() as one:
        found = one.doctor({"t": t, "v": 0.0 * v, "w": 0.0 * w, **still}).findings
    assert not [one for one in found if one.kind == "turned"]
