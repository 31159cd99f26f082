"""The laws of an Online stage, as a public checker.

>>> from typing import NamedTuple
>>> import numpy as np
>>> from evertwin.fold import Out, make_block
>>> class Sum:
...     def init(self): return 0.0
...     def step(self, state, block):
...         for v in block.y[:, 0]: state += float(v)
...         return state, Out()
>>> b = make_block(t=range(5), u=np.zeros((5, 1)), y=np.ones((5, 1)) * 0.1)
>>> check_online(Sum(), b, cuts=[(2,), (1, 3)])
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from evertwin.errors import LawBroken
from evertwin.fold.block import Block, take
from evertwin.fold.online import Online, Out
from evertwin.fold.records import canonical
from evertwin.fold.state import copy, equal, load, save


def fold(stage: Online[Any, Block], blocks: Iterable[Block], state: Any = None) -> tuple[Any, Out]:
    """``stage`` over consecutive blocks: the final state and the concatenated `Out`."""
    state = stage.init() if state is None else state
    outs = []
    for block in blocks:
        state, out = stage.step(state, block)
        outs.append(out)
    return state, join(outs)


def join(outs: Sequence[Out]) -> Out:
    """Outputs of consecutive steps as one."""
    rows = [out.rows for out in outs if out.rows is not None]
    joined = None
    if rows:
        columns = zip(*rows, strict=True)
        joined = type(rows[0])(*(np.concatenate(column) for column in columns))
    records = tuple(record for out in outs for record in out.records)
    requests = tuple(request for out in outs for request in out.requests)
    return Out(joined, records, requests)


def check_online(
    stage: Online[Any, Block], block: Block, cuts: Iterable[Sequence[int]] = ()
) -> None:
    """Checks the laws of an Online stage on ``block``.

    Laws: *partition* (for blocks of one and for each of ``cuts``, positions in increasing order),
    *init is pure*, *state survives save and load*, *step is deterministic*.

    Raises:
        LawBroken: names the law and where it broke.
    """
    if not equal(stage.init(), stage.init()):
        raise LawBroken("init is pure: two calls gave different states")
    whole = fold(stage, [block])
    if not _agree(whole, fold(stage, [block])):
        raise LawBroken("determinism: the same block gave another result the second time")
    n = len(block.t)
    for cut in [range(1, n), *cuts]:
        edges = [0, *cut, n]
        pieces = [take(block, a, b) for a, b in pairwise(edges) if b > a]
        if not _agree(whole, fold(stage, pieces)):
            raise LawBroken(f"partition: cut at {list(cut)[:8]} gave another state or output")
    half = n // 2
    if half:
        state, first = fold(stage, [take(block, 0, half)])
        state = load(save(copy(state)), like=stage.init())
        state, second = fold(stage, [take(block, half, n)], state)
        if not _agree(whole, (state, join([first, second]))):
            raise LawBroken("checkpoint: the state after save and load folds on differently")


def _agree(a: tuple[Any, Out], b: tuple[Any, Out]) -> bool:
    return (
        equal(a[0], b[0])
        and equal(a[1].rows, b[1].rows)
        and canonical(a[1].records) == canonical(b[1].records)
        and canonical(a[1].requests) == canonical(b[1].requests)
    )
