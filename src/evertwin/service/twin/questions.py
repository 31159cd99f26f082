"""What-if questions, forecasts, lives and choices of a running twin, answered beside its work.

The newest rows of the newest task are what is looked ahead from. The answer is computed with a
second copy of the twin, which only reads its store, in a thread of its own; one at a time
for each twin.
"""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from evertwin.ahead.spec import SCENARIO, ScenarioSpec
from evertwin.config import TwinSpec
from evertwin.engine.process import run_alone
from evertwin.errors import UsageError
from evertwin.fold import Block
from evertwin.publishers.contract import Kind
from evertwin.settings.decode import decode
from evertwin.settings.document import Given
from evertwin.twin import Twin

if TYPE_CHECKING:
    from evertwin.service.twin.runner import Runner

ROWS = 4096
"""Newest rows that a question looks at."""
LONG = 120.0
"""Seconds that an answer in a process of its own may take."""
LONGEST = 86_400.0
"""Seconds that a forecast reaches at most."""


async def answer(runner: Runner, kind: Kind, question: Mapping[str, Any]) -> Mapping[str, Any]:
    """The answer to a scenario's table, to ``{"horizon": seconds}``, or how long its parts live.

    Raises:
        UsageError: the question cannot be meant, or the twin is not at work.
        DataError: there are no rows yet.
    """
    asked: ScenarioSpec | float | None = None
    if kind != "life":
        asked = _scenario(question) if kind == "whatif" else _horizon(question)
    async with runner.turn:
        rows = await runner.ask(lambda work: work.newest_blocks(ROWS)[-1])
        work = runner.work
        assert work is not None
        return await asyncio.to_thread(_answered, work.spec, asked, rows)


async def beside(
    runner: Runner, job: Callable[[TwinSpec, Sequence[Block]], Mapping[str, Any]]
) -> Mapping[str, Any]:
    """What takes seconds, of the newest rows of whatever tasks they are of: in a process of its
    own, so that no twin's rows wait for it.

    Raises:
        UsageError: the twin is not at work.
        ConfigError: its breakdown cannot be read.
        DataError: there are no rows yet.
        WorkLost: it took longer than `LONG`, or its process died.
    """
    async with runner.turn:
        blocks = await runner.ask(lambda work: work.newest_blocks(ROWS))
        work = runner.work
        assert work is not None
        found: Mapping[str, Any] = await asyncio.to_thread(
            run_alone, partial(job, work.spec, blocks), LONG
        )
        return found


def _scenario(question: Mapping[str, Any]) -> ScenarioSpec:
    """A scenario without files: what comes over a line names none of this machine's."""
    table = {"schema": 1, "name": "asked", **question}
    found = decode(SCENARIO.root, Given(table, "question"))
    if found.docking is not None or (found.path is not None and found.path.file is not None):
        raise UsageError("question: docking and path.file name files: ask with evertwin whatif")
    return found


def _horizon(question: Mapping[str, Any]) -> float:
    horizon = question.get("horizon")
    number = isinstance(horizon, int | float) and not isinstance(horizon, bool)
    if not number or not 0.0 < float(horizon or 0.0) <= LONGEST or len(question) != 1:
        raise UsageError(f"question: expected horizon, above 0 and at most {LONGEST:g} s alone")
    return float(horizon or 0.0)


def reading(spec: TwinSpec) -> Twin:
    """A second copy of a twin, which only reads its store."""
    quiet = dataclasses.replace(spec, engine=dataclasses.replace(spec.engine, workers=0))
    return Twin(quiet, reading=True)


def _answered(spec: TwinSpec, asked: ScenarioSpec | float | None, rows: Block) -> Mapping[str, Any]:
    with reading(spec) as twin:
        if isinstance(asked, ScenarioSpec):
            return twin.whatif(asked, rows).to_dict()
        if asked is None:
            return {**twin.life(data=rows).to_dict(), "plan": planned(twin, rows)}
        return twin.forecast(asked, rows).to_dict()


def planned(twin: Twin, rows: Block) -> Mapping[str, Any] | None:
    """The dates of maintenance; None where no costs are stated."""
    costs = twin.setup.spec.prognosis.components.values()
    return twin.plan(data=rows).to_dict() if any(c.failure is not None for c in costs) else None
