"""The one idea: a twin is a fold over blocks.

Blocks of rows go in, state goes along, rows, records and requests come out; where the data is cut
never matters. `check_online` tests the laws of any stage.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.fold.beats import Beat as Beat
    from evertwin.fold.block import (
        Block as Block,
        Windows as Windows,
        concatenate as concatenate,
        make_block as make_block,
        take as take,
    )
    from evertwin.fold.chunk import Chunk as Chunk
    from evertwin.fold.laws import check_online as check_online, fold as fold, join as join
    from evertwin.fold.marks import Mark as Mark
    from evertwin.fold.online import Online as Online, Out as Out
    from evertwin.fold.records import (
        Answer as Answer,
        Event as Event,
        Record as Record,
        Request as Request,
        canonical as canonical,
        interval as interval,
        plain as plain,
    )
    from evertwin.fold.state import copy as copy, equal as equal, load as load, save as save

__getattr__ = surface(__name__)
