"""Machine code before a twin begins: no row waits for a compiler, nor does a first correction.

Or beside it: the twin runs plain, and has its machine code once another process has made it.

Rows of zeros go through a copy that keeps nothing; what zeros do not reach (terms of corrections,
a trial, a limit that was held and is not any more) is called by itself.
"""

from __future__ import annotations

import asyncio
import dataclasses
import logging
import os
import threading
from collections.abc import Sequence
from functools import partial

import numpy as np

from evertwin.anomaly.run_length import limit_for
from evertwin.compiled.functions import at_once
from evertwin.config.read import recorded
from evertwin.config.spec import ArraySpec, TwinSpec
from evertwin.engine import EngineSpec, Pool
from evertwin.features.perception import Perception
from evertwin.fold import Chunk
from evertwin.models.contract import PartialModel
from evertwin.models.terms import kernel
from evertwin.refit.workers import setup_of
from evertwin.service.twin.twin_status import MAKING
from evertwin.setup.deviation import new_usual
from evertwin.setup.scores import NEVER, exceeds, new_scores
from evertwin.setup.setup import Setup
from evertwin.store.spec import StoreSpec
from evertwin.trial import Recovery
from evertwin.twin import Twin

LOG = logging.getLogger("evertwin.service")
NICE = (0, 10)
"""Processes that compile side by side, at most, and by how much machines and twins go before each:
what twins wait for comes first."""
LONGEST = 3600.0
"""Time that compiling for one twin may take [s]."""


class Beside:
    """Compiles what twins need in processes of their own; until it is done each function of this
    process runs plain until its machine code is there, or would pay. Scans alone are more than
    plain Python keeps up with: a twin that perceives waits for their code.

    >>> Beside.__name__
    'Beside'
    """

    def __init__(self, specs: Sequence[TwinSpec]) -> None:
        perceive = [(warm_scans, spec) for spec in specs if spec.perception is not None]
        rest = [(job, spec) for job in (warm_early, warm) for spec in specs]
        self._waiting, self._scans = iter([*perceive, *rest]), len(perceive)
        self._perceiving = threading.Event()
        if not perceive:
            self._perceiving.set()

    def wait(self, spec: TwinSpec) -> None:
        """Until a twin may begin."""
        if spec.perception is not None and not self._perceiving.is_set():
            _say(spec)
            self._perceiving.wait()

    async def run(self) -> None:
        """One twin after the other: scans, what is felt first, then the rest."""
        try:
            await asyncio.gather(*(self._lane(nice) for nice in NICE[: os.cpu_count()]))
            at_once()
        finally:
            self._perceiving.set()

    async def _lane(self, nice: int) -> None:
        """Takes what is next as long as something waits."""
        pool = Pool(1, EngineSpec(time=LONGEST, memory=16.0), partial(os.nice, nice))
        try:
            for job, spec in self._waiting:
                done = asyncio.to_thread(pool.map, job, [spec])
                (wrong,) = await asyncio.gather(done, return_exceptions=True)
                if isinstance(wrong, BaseException):  # its start says the same, and ends it
                    LOG.warning("%s: not compiled before it pays: %s", spec.name, wrong)
                self._scans -= job is warm_scans
                if not self._scans:
                    self._perceiving.set()
        finally:
            await asyncio.to_thread(pool.close)


def warm_scans(spec: TwinSpec) -> None:
    """Scans to poses: of a robot that stands between two walls, and then looks elsewhere."""
    rule = spec.perception
    beams = next((one.shape[0] for one in spec.array if rule and one.name == rule.scan), 0)
    lidar = rule.lidar(beams) if rule and beams else None
    if rule is None or lidar is None:
        return
    at_once()
    stage = Perception(rule.scan, lidar, beams)
    walls = 2.0 / np.maximum(np.abs(np.sin(lidar.angles(beams))), 0.2)
    scans = Chunk(rule.scan, np.arange(3) * 10**9, np.array([walls, walls, np.roll(walls, 9)]))
    stage.step(stage.init(), scans)


def warm_early(spec: TwinSpec) -> None:
    """What goes through many rows at once, so plain Python is slow at it: limits of a new version,
    roll-outs, columns of a fit, terms of a correction."""
    at_once()
    model = setup_of(spec).model
    p = model.parameters.values
    u, dt = np.zeros((2, len(model.inputs))), np.full(2, 0.1)
    limit_for(np.random.default_rng(0).normal(size=100), 0.5, 1e4, np.random.default_rng(0))
    model.simulate(model.initial(p), u, dt, p)
    if isinstance(model, PartialModel):
        model.partial(model.initial(p), u, dt, p, model.columns)
    kernel.ready()


def before(spec: TwinSpec) -> None:
    """`warm` in the process of the twin, which says so."""
    _say(spec)
    warm(spec)


def _say(spec: TwinSpec) -> None:
    LOG.info("%s: %s", spec.name, MAKING, extra={"twin": spec.name})


def warm(own: TwinSpec) -> None:
    """Compiles what a twin needs, or reads it from the cache; from now on nothing runs plain."""
    warm_scans(own)
    warm_early(own)
    spec = dataclasses.replace(
        own, store=StoreSpec(), engine=dataclasses.replace(own.engine, workers=0)
    )
    rate = spec.clock.rate or 10.0
    with Twin(spec) as twin:
        for piece in range(4):
            stamps = ((np.arange(50) + 50 * piece) / rate * 1e9).astype(np.int64)
            for one in recorded(spec):  # scans are of a round room
                shape = one.shape if isinstance(one, ArraySpec) else (len(one.channels),)
                value = 2.0 if isinstance(one, ArraySpec) else 0.0
                twin.push(Chunk(one.name, stamps, np.full((50, *shape), value)))
        _decisions(twin.setup)


def _decisions(setup: Setup) -> None:
    """A trial, a probation, and the watch over a version that held."""
    for gate in (setup.trial, setup.probation):
        state = gate.init()
        gate.step(state, np.ones((1, 2 + len(state.harm))))
    Recovery().step(Recovery().init(), np.ones((1, 3)))
    setup.trial.verdict(setup.trial.init())
    ny, usual = len(setup.model.outputs), new_usual(setup.model.outputs.temperatures)
    scores = new_scores(usual, np.zeros(2, dtype=np.int64), 0, np.ones(ny))
    scores.seen[0] = 1
    outputs = np.ones(ny, dtype=np.bool_)
    exceeds(scores.watch, scores.seen, scores.past, scores.usual, NEVER._replace(outputs=outputs))
