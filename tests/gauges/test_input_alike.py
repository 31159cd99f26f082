"""A meter of a current with another zero or scale, or a drive whose numbers changed: both are said
where one number of the meter explains as much as all numbers of the drive."""

from __future__ import annotations

import re

import numpy as np

from evertwin import FunctionModel, Layout, Parameters, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import CorrectionSpec, ModelSpec, PredictionSpec, Span
from evertwin.models.functions.translated import translated
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

ROWS, AT, DT = 3000, 1500, 0.1
NUMBERS = np.array([0.05, 2e-4, 0.1])


def turned(
    x: Vector, u: Vector, dt: float, p: ParameterVector
) -> tuple[list[float], list[float]]:  # fmt: skip
    w = x[0]
    for _ in range(2):
        w = w + dt / 2 * (0.3 * u[0] - p[2] * w / (0.1 + abs(w)) - p[1] * w * abs(w)) / p[0]
    return [w], [w]


def fan(seed: int, zero: float = 0.0, scale: float = 1.0, drag: float = 1.0) -> RunResult:
    """From AT on its current is recorded so, or its drag is so many times what it was."""
    rng, speed = np.random.default_rng(seed), Layout.of(speed="rad/s")
    current, w = 0.0, 50.0
    data = np.empty((ROWS, 2))
    p, other = NUMBERS, NUMBERS * (1.0, drag, 1.0)
    for k in range(ROWS):
        data[k, 1] = w
        current = rng.uniform(2.0, 10.0) if k % 40 == 0 else current
        data[k, 0] = scale * current + zero if k >= AT else current
        w = turned([w], [current], DT, other if k >= AT else p)[0][0]  # type: ignore[arg-type]
    data[:, 1] += rng.normal(0.0, 0.1, ROWS)
    model = FunctionModel(
        turned, Layout.of(current="A"), speed, speed,
        Parameters.of(J=(0.05, "kg*m^2"), c=(2e-4, "Nms^2"), f=(0.1, "Nm")),
    )  # fmt: skip
    spec = TwinSpec(
        "fan", ModelSpec("python"), beat=Span(50), prediction=PredictionSpec(3.0),
        anomaly=AnomalySpec(requirement=1.0, relative=False, window=Span(400)),
    )  # fmt: skip
    columns = dict(zip(("current", "speed"), data.T, strict=True))
    with Twin(spec, translated(model)) as twin:
        return twin.run({"t": DT * np.arange(ROWS)} | columns)


def drawn(
    x: Vector, u: Vector, dt: float, p: ParameterVector
) -> tuple[list[float], list[float]]:  # fmt: skip
    return [], [(p[0] + p[1] * u[0] + p[2] * 9.81 * u[1]) * u[0] + p[3]]


def belt(seed: int, zero: float = 0.0, scale: float = 1.0, viscous: float = 1.0) -> RunResult:
    """A conveyor's power by its speed and load, a static map; from AT on the load is recorded so,
    or viscous friction is so many times what it was."""
    rng, late = np.random.default_rng(seed), np.arange(ROWS) >= AT
    v = np.repeat(rng.uniform(0.2, 1.2, ROWS // 20), 20)
    m = np.repeat(rng.uniform(50.0, 400.0, ROWS // 30), 30)
    numbers = {"F0": (210.0, "N"), "Fv": (90.0, "Ns/m"), "mu": (0.035, "1"), "idle": (180.0, "W")}
    f0, fv, mu, idle = (value for value, _ in numbers.values())
    power = (f0 + fv * np.where(late, viscous, 1.0) * v + mu * 9.81 * m) * v + idle
    read = np.where(late, scale * m + zero, m) + rng.normal(0.0, 2.0, ROWS)
    model = FunctionModel(
        drawn, Layout.of(v="m/s", m="kg"), Layout.of(power="W"),
        parameters=Parameters.of(**numbers),
    )  # fmt: skip
    asked = AnomalySpec(requirement=8.0, relative=False, window=Span(400))
    spec = TwinSpec("belt", ModelSpec("python"), beat=Span(50), anomaly=asked)
    rows = {"t": DT * np.arange(ROWS), "v": v, "m": read}
    with Twin(spec, translated(model)) as twin:
        return twin.run(rows | {"power": power + rng.normal(0.0, 4.0, ROWS)})


def said(result: RunResult) -> str:
    return " ".join(one.reason for kind in ("normal", "abnormal") for one in result.of_kind(kind))


@first_of("seed", [1, 2, 3])
def test_a_meter_of_an_input_that_explains_the_numbers_is_named_beside_them(seed: int) -> None:
    scaled, shifted = fan(seed, scale=0.85), fan(seed, zero=1.2)
    assert "a meter of current that is off by -1" in said(scaled)
    assert re.search(r"or current that acts by 11[678] % of what is recorded", said(scaled))
    assert "a meter of current that is off by +1." in said(shifted) and " A would" in said(shifted)
    for result in (scaled, shifted):  # beside what was learned, which goes live with it
        assert all("a meter of current" in one.reason for one in result.of_kind("promoted"))


@first_of("seed", [1, 2, 3])
def test_a_machine_that_no_meter_looks_like_is_learned_alone(seed: int) -> None:
    result = fan(seed, drag=1.25)
    assert result.of_kind("promoted") and "a meter of" not in said(result)


@first_of("seed", [1, 2, 3])
def test_a_meter_of_an_input_of_a_static_map_is_named_too(seed: int) -> None:
    shifted, scaled = belt(seed, zero=90.0), belt(seed, scale=1.4)
    assert re.search(r"a meter of m that is off by \+(8|9)[.\d]* kg", said(shifted))
    assert "a meter of m that is off by +" in said(scaled) and "or m that acts by 7" in said(scaled)
    moved = belt(seed, viscous=1.8)
    assert moved.of_kind("promoted") and "a meter of" not in said(moved)


@first_of("seed", [1, 2, 3])
def test_a_wheel_that_slips_is_told_and_what_a_correction_waits_for(seed: int) -> None:
    rng, n, pose = np.random.default_rng(seed), 2000, np.zeros(3)
    left = np.repeat(rng.uniform(-6.0, 6.0, n // 40), 40)
    right = np.clip(left + np.repeat(rng.uniform(-2.0, 2.0, n // 40), 40), -6.0, 6.0)
    data = np.zeros((n, 3))
    for k in range(1, n):
        slow = 0.85 * left[k - 1] if k >= 1200 else left[k - 1]
        v, w = 0.05 * (slow + right[k - 1]), 0.2 * (right[k - 1] - slow)
        middle = pose[2] + 0.05 * w
        pose += 0.1 * np.array([v * np.cos(middle), v * np.sin(middle), w])
        data[k] = pose
    data += rng.normal(0.0, 0.003, (n, 3))
    spec = TwinSpec(
        "base", ModelSpec("differential", {"wheels": True, "wheel_radius": 0.1, "wheel_base": 0.5}),
        beat=Span(100), prediction=PredictionSpec(5.0),
        anomaly=AnomalySpec(
            requirement=0.05, relative=False, window=Span(400), outputs=("x", "y")
        ),
        correction=CorrectionSpec(channels=("left", "right"), terms=("table", "law")),
    )  # fmt: skip
    columns = dict(zip(("x", "y", "heading"), data.T, strict=True))
    with Twin(spec) as twin:
        result = twin.run({"t": 0.1 * np.arange(n), "left": left, "right": right} | columns)
    told = said(result)
    assert re.search(r"or left that acts by 8[456][.\d]* % of what is recorded", told)
    assert "or right that acts" not in told
    assert "a correction is looked for from 30 predictions of 5 s on" in told
