"""Machine code before a twin begins: no row waits for a compiler, nor does a first correction.

Rows of zeros go through a copy that keeps nothing; what zeros do not reach (terms of corrections,
a trial, a limit that was held and is not any more) is called by itself.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from evertwin.compiled.functions import at_once
from evertwin.fold import Chunk
from evertwin.loop.deviation import new_usual
from evertwin.loop.scores import NEVER, exceeds, new_scores
from evertwin.loop.setup import Setup
from evertwin.models.terms import kernel
from evertwin.service.plan import Plan
from evertwin.store.spec import StoreSpec
from evertwin.twin import Twin


def warm(plan: Plan) -> None:
    """Compiles what a twin needs, or reads it from the cache; from now on nothing runs plain."""
    assert plan.spec is not None
    at_once()
    spec = dataclasses.replace(
        plan.spec, store=StoreSpec(), engine=dataclasses.replace(plan.spec.engine, workers=0)
    )
    rate = spec.clock.rate or 10.0
    with Twin(spec) as twin:
        for piece in range(4):
            stamps = ((np.arange(50) + 50 * piece) / rate * 1e9).astype(np.int64)
            for one in spec.source:
                twin.push(Chunk(one.name, stamps, np.zeros((50, len(one.channels)))))
        kernel.ready()
        _decisions(twin.setup)


def _decisions(setup: Setup) -> None:
    """A trial, a probation, and the watch over a version that held."""
    for gate in (setup.trial, setup.probation):
        state = gate.init()
        gate.step(state, np.ones((1, 2 + len(state.harm))))
    setup.trial.verdict(setup.trial.init())
    ny = len(setup.model.outputs)
    scores = new_scores(new_usual(ny), np.zeros(2, dtype=np.int64), 0, np.ones(ny))
    scores.seen[0] = 1
    outputs = np.ones(ny, dtype=np.bool_)
    exceeds(scores.watch, scores.seen, scores.usual, NEVER._replace(outputs=outputs))
