"""Two whole twins with short recordings: a robot that learns a table, an arm that is tuned."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from evertwin.config.spec import (
    AnomalySpec,
    ArbiterSpec,
    CorrectionSpec,
    ModelSpec,
    MovingSpec,
    ParameterSpec,
    PredictionSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.fold import Answer, Block, Event, Record, concatenate, make_block, take
from evertwin.ledger.versions import Versions
from evertwin.loop.driver import Driver
from evertwin.models.form import Version
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState
from evertwin.worlds.robot import Plan, light

Answered = dict[int, tuple[int, Answer]]


class Case(NamedTuple):
    """A twin's settings and its rows."""

    spec: TwinSpec
    rows: Block


class Run(NamedTuple):
    """What came of it."""

    state: TwinState
    records: tuple[Record, ...]
    versions: tuple[Version, ...]
    answered: Answered
    """Row and answer of each request."""


@cache
def robot() -> Case:
    """The longitudinal robot: dead zone and cap, learned as a table of 1 cm/s steps."""
    spec = TwinSpec(
        "robot", ModelSpec("robot1d", {}, {"gain": ParameterSpec(editable=True)}), beat=Span(5),
        arbiter=ArbiterSpec(use="tolerance", tolerance=0.02),
        prediction=PredictionSpec(horizon=1.0),
        anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(98)),
        tuning=TuningSpec(window=Span(120)),
        correction=CorrectionSpec(channels=("v",), terms=("table",), quantum=0.01, window=Span(120),
                                  refine=False),
    )  # fmt: skip
    columns = light(3, "w1", Plan(3, 5, 150))
    t = np.rint(columns["t"] * 1e9).astype(np.int64)
    v, x = columns["v_cmd"] / 100, columns["x"] / 100
    held = np.r_[v[:1], v[:-1]]
    return Case(spec, make_block(t=t, u=held[:, None], y=x[:, None]))


@cache
def arm() -> Case:
    """Six axes at 10 Hz, Coulomb friction twice what the twin thinks; three cycles, each a task."""
    rng, cycle, tasks = np.random.default_rng(5), 320, 3
    t = 0.1 * np.arange(cycle)[:, None]
    w, a = rng.uniform(0.3, 0.8, 6), rng.uniform(0.3, 0.9, 6)
    u = np.concatenate(
        [a * np.sin(w * t), a * w * np.cos(w * t), -a * w**2 * np.sin(w * t)], axis=1
    )
    options = {"urdf": "ur5_like", "law": "tanh"}
    truth = {f"Fc{k + 1}": f for k, f in enumerate((12.0, 14.0, 10.0, 3.0, 3.0, 2.5))}
    start = {name: ParameterSpec(value=0.5 * f, low=0.0, high=100.0) for name, f in truth.items()}
    spec = TwinSpec(
        "arm", ModelSpec("arm", options, start), beat=Span(40), arbiter=ArbiterSpec(gate=12.0),
        moving=MovingSpec(channels={f"tau{k}": f"qd{k}" for k in range(1, 7)}, above=0.05),
        prediction=PredictionSpec(horizon=1.0),
        anomaly=AnomalySpec(requirement=0.05, window=Span(300)),
        tuning=TuningSpec(editable=("Fc*",), window=Span(320)),
    )  # fmt: skip
    model = model_of(spec, None)
    p = model.parameters.with_values(truth).values
    _, tau = model.simulate(np.zeros(0), u, np.zeros(cycle), p)
    blocks = []
    for k in range(tasks):
        y = tau + np.array([0.5, 0.8, 0.5, 0.08, 0.08, 0.06]) * rng.normal(size=tau.shape)
        stamps = np.arange(cycle) * 10**8 + k * 10**12
        block = make_block(t=stamps, u=u, y=y, row=k * cycle, task=k)
        gap = block.gap.copy()
        gap[0] = True
        blocks.append(block._replace(gap=gap))
    return Case(spec, concatenate(blocks))


@dataclass
class Told:
    """Answers as they were logged, at the rows that they preceded; no order."""

    answers: Answered

    def answer(self, number: int) -> tuple[int, Answer] | None:
        return self.answers.get(number)

    def knows_more(self) -> bool:
        return False

    def next_order(self) -> float:
        return np.inf

    def heed(self, row: int) -> tuple[Event, ...]:
        return ()


def cut(rows: Block, places: Sequence[int]) -> list[Block]:
    edges = [0, *sorted({p for p in places if 0 < p < len(rows.t)}), len(rows.t)]
    return [take(rows, a, b) for a, b in pairwise(edges)]


def play(
    case: Case, blocks: Iterable[Block], answered: Answered | None = None, **how: Any
) -> Run:  # fmt: skip
    """The whole twin over the blocks; answers to slow work from a log where one is given."""
    setup, records, found = Setup(case.spec, model_of(case.spec)), list[Record](), Answered()
    versions = Versions(setup.model)

    def log(row: int, said: Sequence[Record]) -> None:
        records.extend(said)
        found.update({r.id: (row, r) for r in said if isinstance(r, Answer)})

    if answered is not None:
        how["outside"] = Told(answered)
    driver = Driver(setup, versions, log, **how)
    state = driver.finish(driver.run(blocks))
    return Run(state, tuple(records), tuple(versions), found)


@cache
def whole(name: str) -> Run:
    """The run over one block."""
    case = CASES[name]()
    return play(case, [case.rows])


CASES = {"robot": robot, "arm": arm}
