"""A command of a few levels: what is a thousand times as much is no speed, ten times may be one."""

from __future__ import annotations

import numpy as np
import pytest

from planted.robots import RATE, SIGMA, WAYS, Run, drive, followed

ONSET, LONG = 130, 100


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("way", "factor"), [(WAYS[2], 100.0), (WAYS[2], 1000.0), (WAYS[3], 1000.0)]
)
def test_a_command_in_another_unit_is_told_among_few_levels(
    way: str, seed: int, factor: float
) -> None:
    run = drive(seed, way=way)
    v = run.v.copy()
    v[ONSET : ONSET + LONG] *= factor
    result = followed(run._replace(v=v))
    assert {one.signal for one in result.of_kind("measurement_error")} == {"v"}
    off = result.trace["predicted"][:, 0] - run.truth
    assert np.sqrt(np.nanmean(off**2)) < 0.1


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("growth", [2.0, 3.0, 10.0])
def test_steps_that_grow_are_no_error_of_the_command(growth: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    v = np.repeat(0.004 * rng.uniform(0.5, 1.0) * growth ** np.arange(4.0), 60)
    truth = np.concatenate([[0.0], np.cumsum(np.clip(v, 0.0, 0.15)[1:] / RATE)])
    y = truth + rng.normal(0.0, SIGMA, len(v))
    result = followed(Run(v, y, truth, np.zeros(len(v), dtype=np.bool_)), gain=1.0)
    assert not [one for one in result.of_kind("measurement_error") if one.signal == "v"]
