"""What-if questions, forecasts and lives of a running twin, answered beside its work.

The newest rows of the newest task are what is looked ahead from. The answer is computed with a
second copy of the twin, which only reads its store, in a thread of its own; one at a time
for each twin.
"""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from evertwin.ahead.spec import SCENARIO, ScenarioSpec
from evertwin.config import TwinSpec
from evertwin.errors import UsageError
from evertwin.fold import Block
from evertwin.publishers.contract import Kind
from evertwin.settings.decode import decode
from evertwin.settings.document import Given
from evertwin.twin import Twin

if TYPE_CHECKING:
    from evertwin.service.runner import Runner

ROWS = 4096
"""Newest rows that a question looks at."""
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
        rows = await runner.ask(lambda work: work.newest_block(ROWS))
        work = runner.work
        assert work is not None
        return await asyncio.to_thread(_answered, work.spec, asked, rows)


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


def _answered(spec: TwinSpec, asked: ScenarioSpec | float | None, rows: Block) -> Mapping[str, Any]:
    quiet = dataclasses.replace(spec, engine=dataclasses.replace(spec.engine, workers=0))
    with Twin(quiet, reading=True) as twin:
        if isinstance(asked, ScenarioSpec):
            return twin.whatif(asked, rows).to_dict()
        if asked is None:
            return twin.life(data=rows).to_dict()
        return twin.forecast(asked, rows).to_dict()
