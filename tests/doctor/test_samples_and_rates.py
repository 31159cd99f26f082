"""Held samples, recordings that are there twice, speeds that contradict their positions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.doctor import Finding
from evertwin.doctor.check_rates import contradiction, look_rates, same_motion
from evertwin.doctor.check_samples import held_rows, look_samples
from evertwin.doctor.examination import view
from evertwin.ledger.versions import Versions
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.twin import Twin

SEEDS = range(20)
ROWS = 2000
LAYOUT = Layout.of(q1="rad", qd1="rad/s")


def motion(rng: np.random.Generator, rows: int = ROWS, late: float = 0.0) -> Any:
    """Position and speed of a joint at 100 Hz, the speed late by rows."""
    t = 0.01 * np.arange(rows)
    q, speed = np.zeros(rows), np.zeros(rows)
    for rate, at in zip(rng.uniform(0.3, 6.0, 6), rng.uniform(0, 6.28, 6), strict=True):
        q += np.sin(rate * t + at) / rate
        speed += np.cos(rate * (t - 0.01 * late) + at)
    return q, speed


def joint() -> FunctionModel:
    return FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * u[1] + p[1] * u[0]]), LAYOUT, Layout.of(tau1="Nm"),
        parameters=Parameters.of(Fv=(2.0, "Nms/rad"), spring=(3.0, "Nm/rad")),
    )  # fmt: skip


def examined(twin: Twin, data: Any) -> tuple[dict[str, Any], list[Finding]]:
    """Figures and findings of the two looks."""
    seen = view(twin.setup, Versions(twin.model), 0, data)
    figures: dict[str, Any] = {}
    return figures, [*look_samples(seen), *look_rates(seen, figures)]


def moved(q: Any, speed: Any) -> tuple[dict[str, Any], list[Finding]]:
    tau = 2 * speed + 3 * q + np.random.default_rng(0).normal(0, 0.02, len(q))
    columns = {"t": 0.01 * np.arange(len(q)), "q1": q, "qd1": speed, "tau1": tau}
    return examined(Twin(TwinSpec("joint", ModelSpec("python")), joint()), columns)


def told(q: Any, speed: Any) -> list[Any]:
    """What is said of one position and one speed, with the figures behind it."""
    found = same_motion([(np.full(len(q), 0.01), q, speed)])
    findings = [] if found is None else contradiction("q1", "qd1", found, 0.01)
    return [dict(one.evidence) | {"said": one.reason} for one in findings]


@pytest.mark.parametrize("factor", [3.0, -1.0, 57.3, 1e-3, 1.3])
def test_a_factor_between_speed_and_position_is_told_with_its_interval(factor: float) -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        q, speed = motion(rng)
        noisy = factor * (speed + rng.normal(0, 0.1, ROWS))
        (found,) = told(q + rng.normal(0, 1e-3, ROWS), noisy)
        low, high = found["interval95"]
        assert low < factor + 0.02 * abs(factor) and high > factor - 0.02 * abs(factor)
        assert "times the rate" in found["said"]
        assert abs(found["factor"] / factor - 1) < 0.05


def test_a_lag_is_a_lag_and_no_factor() -> None:
    for seed in SEEDS:
        late = 8.0 if seed % 2 else -8.0
        q, speed = motion(np.random.default_rng(seed), late=late)
        (found,) = told(q, speed)
        assert found["lag"] == pytest.approx(0.01 * late, abs=0.003)
        assert ("later" if late > 0 else "earlier") in found["said"]


def test_the_speed_of_another_joint_has_nothing_in_common() -> None:
    unlike = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        found = told(motion(rng, 6000)[0], motion(rng, 6000)[1])
        unlike += any("nothing in common" in one["said"] for one in found)
    assert unlike >= 18


def coarse(values: Any, steps: float) -> Any:
    size = float(np.ptp(values)) / steps
    return np.round(values / size) * size


@pytest.mark.parametrize(
    "spoil",
    [
        lambda rng, q, v: (q, v),
        lambda rng, q, v: (q + rng.normal(0, 0.02, ROWS), v + rng.normal(0, 1.0, ROWS)),
        lambda rng, q, v: (coarse(q, 50), v),
        lambda rng, q, v: (coarse(q, 300), np.gradient(coarse(q, 300), 0.01)),
        lambda rng, q, v: (q, coarse(v, 20)),
        lambda rng, q, v: (q, v + 1.0),
        lambda rng, q, v: (rng.normal(0, 1e-3, ROWS), rng.normal(0, 1e-2, ROWS)),
        lambda rng, q, v: (0 * q + 1.2, 0 * v),
        lambda rng, q, v: (q, 1.05 * v),
    ],
    ids=["clean", "noise", "steps", "differences", "coarse", "bias", "rest", "still", "5_percent"],
)
def test_a_sound_joint_raises_nothing(spoil: Callable[..., Any]) -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        assert told(*spoil(rng, *motion(rng))) == []


@pytest.mark.parametrize("times", [3, 40])
def test_a_motion_that_is_repeated_raises_nothing(times: int) -> None:
    t = 0.1 * np.arange(690)
    for seed in SEEDS[:5]:
        share, rng = np.clip(t / 69.0, 0, 1), np.random.default_rng(seed)
        bends = rng.normal(size=4)
        q = sum(a * np.sin((k + 1) * np.pi * share) ** 2 for k, a in enumerate(bends))
        piece = np.full(len(t), 0.1), np.asarray(q), np.gradient(np.asarray(q), 0.1)
        found = same_motion([piece] * times)
        assert found is not None and abs(found.factor - 1) < 0.01
        assert list(contradiction("q1", "qd1", found, 0.1)) == []


def test_the_measured_inputs_of_a_static_map_are_compared() -> None:
    q, speed = motion(np.random.default_rng(0))
    figures, found = moved(q, speed)
    assert found == [] and figures["rates"]["qd1 of q1"].common > 0.99
    _, (finding,) = moved(q, 3 * speed)
    assert (finding.kind, finding.subject) == ("rate", "qd1") and "unit of time" in finding.step


@pytest.mark.parametrize("rows", [2, 3, 10, 10 / 3])
def test_held_samples_are_told_with_their_rows(rows: float) -> None:
    for seed in SEEDS:
        q, _ = motion(np.random.default_rng(seed))
        i = np.arange(ROWS)
        at = np.floor(np.floor(i / rows) * rows + 0.5).astype(int)
        held = q[at]
        held[600:1200] = held[600]  # at rest for a while
        assert held_rows([held]) == pytest.approx(rows, abs=0.02)


@pytest.mark.parametrize(
    "signal",
    [
        lambda rng, q: q,
        lambda rng, q: coarse(q, 1000),
        lambda rng, q: coarse(q, 20),
        lambda rng, q: coarse(q + rng.normal(0, 0.01, ROWS), 100),
        lambda rng, q: np.floor(np.arange(ROWS) / 3.0),
        lambda rng, q: 0 * q,
        lambda rng, q: np.repeat(rng.normal(size=ROWS // 40), 40),
        lambda rng, q: np.repeat(rng.normal(size=ROWS), rng.integers(5, 200, ROWS))[:ROWS],
        lambda rng, q: q[np.maximum.accumulate(np.where(rng.random(ROWS) < 0.5, 0, range(ROWS)))],
    ],
    ids=["moving", "fine", "coarse", "dither", "encoder", "rest", "steps", "at_random", "lost"],
)
def test_what_stands_for_other_reasons_is_not_held(signal: Callable[..., Any]) -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        assert held_rows([signal(rng, motion(rng)[0])]) == 0.0


def test_held_channels_are_named_together() -> None:
    q, speed = motion(np.random.default_rng(1))
    at = np.arange(ROWS) // 3 * 3
    _, (found,) = moved(q[at], speed[at])
    assert found.evidence == {"channels": ["q1", "qd1"], "rows": 3.0} and found.kind == "held"
    assert "cutoff below 17 Hz" in found.step and "33 Hz" in found.step


TWIN = """
schema = 1
name = "joint"
model = { kind = "python", options.file = "joint.py" }

[[source]]
name = "log"
time = "t"
channels."{q1,qd1,tau1}" = { column = "{q1,qd1,tau1}", unit = "{rad,rad/s,Nm}" }
"""
MODEL = """
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
model = FunctionModel(
    lambda x, u, dt, p: ([], [p[0] * u[1] + p[1] * u[0]]),
    Layout.of(q1="rad", qd1="rad/s"), Layout.of(tau1="Nm"),
    parameters=Parameters.of(Fv=(2.0, "Nms/rad"), spring=(3.0, "Nm/rad")),
)
"""


def test_recordings_that_are_there_twice_are_named(tmp_path: Path) -> None:
    (tmp_path / "joint.toml").write_text(TWIN)
    (tmp_path / "joint.py").write_text(MODEL)
    files = [tmp_path / f"{name}.csv" for name in "abcd"]
    for number, file in enumerate(files):
        rng = np.random.default_rng(number % 3)  # d's torque is a's
        q, speed = motion(rng, 300)
        tau = 2 * speed + 3 * q + rng.normal(0, 0.02, 300)
        if number == 3:
            q = q + np.random.default_rng(9).normal(0, 1e-3, 300)
        table = np.column_stack([0.01 * np.arange(300) + number, q, speed, tau])
        np.savetxt(file, table, delimiter=",", header="t,q1,qd1,tau1", comments="")
    with Twin.open(tmp_path / "joint.toml", reading=True) as twin:
        _, (found,) = examined(twin, files)
        assert examined(twin, files[:3])[1] == []
        assert examined(twin, [f"{files[0]}@:1.5", f"{files[0]}@1.5:"])[1] == []
    assert found.evidence["pairs"] == [["a.csv", "d.csv"]]
    assert "tau1" in found.reason and "1 of 4" in found.step
