"""Older days of a running twin go to files, written beside its work.

>>> AGAIN
600.0
"""

from __future__ import annotations

import asyncio
import logging
from functools import partial
from typing import TYPE_CHECKING

from evertwin.errors import EvertwinError
from evertwin.service.twin.live_twin import AtWork
from evertwin.store import SqliteStore

if TYPE_CHECKING:
    from evertwin.service.twin.runner import Runner

LOG = logging.getLogger("evertwin.service")
AGAIN = 600.0
"""Seconds from one look for older days to the next."""


async def keep_days(runner: Runner, days: int) -> None:
    """Looks for older days again and again; what cannot be written is tried again.

    Args:
        runner: of the twin.
        days: so many of the newest stay in its store.
    """
    while True:
        try:
            await _put_away(runner, days)
        except (EvertwinError, OSError) as error:
            LOG.error("%s: older days stay in the store: %s", runner.name, error)
        await asyncio.sleep(AGAIN)


async def _put_away(runner: Runner, days: int) -> None:
    for source, day, names in await runner.ask(lambda work: work.old(days)):
        reader = runner.reader
        assert isinstance(reader, SqliteStore)  # no other has old days
        pieces = reader.of_day(source, day)
        written = await asyncio.to_thread(reader.archive.write, source, day, pieces, names)
        if written is not None:
            await runner.done(partial(AtWork.archived, day=written))
