"""A task that repeats: each of its steps is judged by what is usual in it."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec, StepsSpec
from evertwin.config.spec import ModelSpec
from evertwin.fold import Block, make_block
from evertwin.fold.span import Span

ROWS, TASKS, OFF = 100, 60, 45
"""Rows of a task at 1 Hz; tasks; the task from which the calm step is off."""


def tasks(off: float, until: int = TASKS) -> Block:
    """Half of each task is calm (σ 0.1), half is not (σ 1)."""
    rng, i = np.random.default_rng(2), np.arange(TASKS * ROWS)
    calm = i % ROWS < ROWS // 2
    noise = rng.normal(size=len(i)) * np.where(calm, 0.1, 1.0)
    noise += off * (calm & (i >= OFF * ROWS) & (i < until * ROWS))
    u = rng.normal(size=(len(i), 1))
    return make_block(i * 10**9, u, u + noise[:, None], task=i // ROWS)


def ran(spec: AnomalySpec, rows: Block) -> RunResult:
    """What a run over the press says."""
    model = FunctionModel(lambda x, u, dt, p: (x, u), Layout.of(u="1"), Layout.of(y="1"))
    with Twin(TwinSpec("press", ModelSpec("given"), anomaly=spec), model) as twin:
        return twin.run([rows])


def alarms(steps: StepsSpec | None, off: float) -> list[int]:
    """Rows at which something was found that became a suspicion."""
    events = ran(AnomalySpec(steps=steps), tasks(off)).of_kind("suspected")
    found = [event.evidence["row"] for event in events]
    return [row for row in found if isinstance(row, int)]


@pytest.mark.parametrize("off", [0.0, 0.4])
def test_a_calm_step_is_held_to_its_own_limits(off: float) -> None:
    found = alarms(StepsSpec(duration=float(ROWS), parts=2), off)
    assert bool(found) is (off > 0.0)
    if found:
        assert OFF * ROWS <= found[0] < (OFF + 1) * ROWS
    assert not any(OFF * ROWS <= row < (OFF + 1) * ROWS for row in alarms(None, off))


@pytest.mark.parametrize(("until", "lasts"), [(TASKS, True), (50, False)])
def test_the_step_is_named_and_stays_open_while_it_lasts(until: int, lasts: bool) -> None:
    steps = StepsSpec(duration=float(ROWS), parts=2)
    spec = AnomalySpec(requirement=1.2, relative=False, steps=steps, window=Span(ROWS))
    result = ran(spec, tasks(1.0, until))
    first = result.of_kind("suspected")[0]
    assert first.evidence["step"] == 1
    assert "in step 1 of 2 (0 to 50 s of each task)" in first.reason
    assert result.outputs["y"].held is not lasts
    assert ("which lasts" in result.headline) is lasts
    assert ("has held since" in result.headline) is not lasts
