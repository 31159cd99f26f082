"""Rows that are lent to a loop: see `evertwin.compiled.memory.borrowed`."""

from __future__ import annotations

from evertwin.compiled.functions import njit
from evertwin.compiled.memory import borrowed
from evertwin.fold import Block
from evertwin.sync.options import HOT


@njit(**HOT)
def lent_block(block: Block) -> Block:
    """The same arrays without an owner."""
    return Block(
        block.row, borrowed(block.t), borrowed(block.dt), borrowed(block.u), borrowed(block.y),
        borrowed(block.mark), borrowed(block.task), borrowed(block.gap),
    )  # fmt: skip
