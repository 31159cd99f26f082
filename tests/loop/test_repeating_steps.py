"""A task that repeats: each of its steps is judged by what is usual in it."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec, StepsSpec
from evertwin.config.spec import ModelSpec
from evertwin.fold import Block, make_block

ROWS, TASKS, OFF = 100, 60, 45
"""Rows of a task at 1 Hz; tasks; the task from which the calm step is off."""


def tasks(off: float) -> Block:
    """Half of each task is calm (σ 0.1), half is not (σ 1)."""
    rng, i = np.random.default_rng(2), np.arange(TASKS * ROWS)
    calm = i % ROWS < ROWS // 2
    noise = rng.normal(size=len(i)) * np.where(calm, 0.1, 1.0)
    noise += off * (calm & (i >= OFF * ROWS))
    u = rng.normal(size=(len(i), 1))
    return make_block(i * 10**9, u, u + noise[:, None], task=i // ROWS)


def alarms(steps: StepsSpec | None, off: float) -> list[int]:
    """Rows at which something was found that became a suspicion."""
    model = FunctionModel(lambda x, u, dt, p: (x, u), Layout.of(u="1"), Layout.of(y="1"))
    spec = TwinSpec("press", ModelSpec("given"), anomaly=AnomalySpec(steps=steps))
    with Twin(spec, model) as twin:
        twin.run([tasks(off)])
        found = [event.evidence["row"] for event in twin.events if event.kind == "suspected"]
        return [row for row in found if isinstance(row, int)]


@pytest.mark.parametrize("off", [0.0, 0.4])
def test_a_calm_step_is_held_to_its_own_limits(off: float) -> None:
    found = alarms(StepsSpec(duration=float(ROWS), parts=2), off)
    assert bool(found) is (off > 0.0)
    if found:
        assert OFF * ROWS <= found[0] < (OFF + 1) * ROWS
    assert not any(OFF * ROWS <= row < (OFF + 1) * ROWS for row in alarms(None, off))
