"""A wrong description is no load: beside a version that never held, a load has to have come."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import RunResult, Twin
from evertwin.config.spec import ModelSpec, ParameterSpec
from evertwin.fold import make_block
from tests.loop.test_states import RATE, REST, SPEC


def run(described: float, came: float = 0.0, mass: float = 0.0) -> RunResult:
    """A table of 90 kg, described as another; it takes up ``mass`` after ``came`` seconds."""
    rng, t = np.random.default_rng(1), np.arange(round(80 * RATE)) / RATE
    rates, phases = np.array([0.9, 2.3, 4.1]), rng.uniform(0.0, 6.0, 3)
    v = (0.1 * np.sin(np.outer(t, rates) + phases)).sum(axis=1)
    a = (0.1 * rates * np.cos(np.outer(t, rates) + phases)).sum(axis=1)
    force = (90.0 + mass * (t >= came)) * a + 200.0 * v + 20.0 * np.sign(v)
    rows = make_block(
        t=np.round(t * 1e9).astype(np.int64), u=np.stack([v, a], axis=1),
        y=(force + rng.normal(0.0, 0.5, len(t)))[:, None],
    )  # fmt: skip
    values = {n: ParameterSpec(value=v) for n, v in (REST | {"mass": described}).items()}
    tuning = replace(SPEC.tuning, editable=("mass", "Fv", "Fc"))
    with Twin(replace(SPEC, model=ModelSpec("drive_force", {}, values), tuning=tuning)) as twin:
        return twin.run(rows)


@pytest.mark.parametrize("described", [270.0, 30.0])
def test_a_wrong_description_is_no_load(described: float) -> None:
    result = run(described)
    assert not result.of_kind("state")
    assert result.of_kind("promoted")[-1].reason.count(" → 90")


def test_a_load_that_comes_is_told() -> None:
    (told,) = run(90.0, came=40.0, mass=35.0).of_kind("state")
    assert told.reason.startswith("moves 125 ± ")
