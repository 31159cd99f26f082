"""What a sensor would look the same as goes live with a caveat, which stays until it is decided."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, ParameterSpec, PredictionSpec
from evertwin.models import Parameters
from evertwin.models.form import Form, Version
from evertwin.refit.tuner.channels import caveats
from evertwin.setup.task import Task
from planted.draws import first_of

STEP, SECOND, END = 2000, 4500, 7000


def conveyor(seed: int, offset: float, slope: float) -> dict[str, np.ndarray]:
    """A power by speed, whose meter reads ``offset`` more from a row on; later the slope grows."""
    rng, n = np.random.default_rng(seed), END
    at = np.arange(n)
    u = 1.5 + 0.5 * np.sin(at * 0.07 + rng.uniform(0, 6)) + 0.2 * np.sin(at * 0.031)
    y = 1.4 + (2.6 + slope * (at >= SECOND)) * u + offset * (at >= STEP)
    return {"t": at * 0.01, "u": u, "y": y + 0.05 * rng.normal(size=n)}


def line(x: Any, u: Any, dt: float, p: Any) -> Any:
    return x, [p[0] + p[1] * u[0]]


def twin() -> Twin:
    model = FunctionModel(
        line, Layout.of(u="1"), Layout.of(y="W"),
        parameters=Parameters.of(c0=(1.4, "W"), c1=(2.6, "W")),
    )  # fmt: skip
    free = {name: ParameterSpec(editable=True) for name in ("c0", "c1")}
    asked, ahead = (
        AnomalySpec(requirement=0.3, relative=False, unit="W"),
        PredictionSpec(horizon=0.1),
    )
    spec = TwinSpec("belt", ModelSpec("given", {}, free), prediction=ahead, anomaly=asked)
    return Twin(spec, model)


@first_of("seed", [1, 2])
def test_the_caveat_of_a_promotion_stays_with_the_versions_after_it(seed: int) -> None:
    with twin() as belt:
        result = belt.run(conveyor(seed, 5.0, 1.5))
        went = [e for e in belt.events if e.kind == "promoted"]
    assert len(went) >= 2, [e.reason for e in belt.events]
    said = "a sensor of y that is off by"
    assert all(said in e.reason and "would look the same" in e.reason for e in went)
    assert said in result.headline


@first_of("seed", [1, 2])
def test_what_a_sensor_would_be_off_by_is_told_against_the_first_version(seed: int) -> None:
    """Not against the second, which has followed the sensor."""
    data = conveyor(seed, 5.0, 0.0)
    data["y"][SECOND:] += 3.0
    with twin() as belt:
        result = belt.run(data)
    told = [e.reason for e in result.of_kind("promoted")]
    sizes = [float(one.split("that is off by ")[1].split(" W")[0]) for one in told]
    assert np.allclose(sizes, [5.0, 8.0], atol=0.1), told
    assert f"(since row {STEP})" in told[1] and result.headline.count("would look the same") == 1


def test_a_machine_that_no_sensor_looks_like_has_no_caveat() -> None:
    with twin() as belt:
        belt.run(conveyor(3, 0.0, 1.5))
        went = [e for e in belt.events if e.kind == "promoted"]
    assert went and not any("would look the same" in e.reason for e in went)


def test_a_named_cause_ends_the_caveat_and_a_newer_one_takes_its_place() -> None:
    same = "a sensor of pow that is off by +5 kW at row 9 would look the same"
    newer = "a sensor of pow that is off by +6 kW at row 99 would look the same"
    live = Version(1, Form(), ("c",), (1.0,), reason=f"tuned c; {same}")

    def reason(told: str, cause: str = "") -> str:
        content = {"candidate": {"reason": told}}
        caveats(Task("fit", live, (), 0, cause=cause), content)
        return content["candidate"]["reason"]

    assert reason("tuned c") == f"tuned c; {same}"
    assert reason(f"tuned c; {newer}") == f"tuned c; {newer}"
    assert reason("tuned c", cause="wear") == "tuned c"
