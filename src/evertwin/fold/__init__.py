"""The one idea: a twin is a fold over blocks.

Blocks of rows go in, state goes along, rows, records and requests come out; where the data is cut
never matters. `check_online` tests the laws of any stage.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.fold.beats import Beat
    from evertwin.fold.block import Block, concatenate, make_block, take
    from evertwin.fold.chunk import Chunk
    from evertwin.fold.laws import check_online, fold, join
    from evertwin.fold.marks import Mark
    from evertwin.fold.online import Online, Out
    from evertwin.fold.records import Answer, Event, Record, Request, canonical, plain
    from evertwin.fold.state import copy, equal, load, save

__all__ = [
    "Answer",
    "Beat",
    "Block",
    "Chunk",
    "Event",
    "Mark",
    "Online",
    "Out",
    "Record",
    "Request",
    "canonical",
    "check_online",
    "concatenate",
    "copy",
    "equal",
    "fold",
    "join",
    "load",
    "make_block",
    "plain",
    "save",
    "take",
]

__getattr__ = surface(__name__)
