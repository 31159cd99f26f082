"""How long a running twin's components last, told anew whenever what tells wear was tuned, or what
of it counts has changed.

It is looked at beside the twin's work, in a process of its own; alarms that are due, or clear, go
into the log, and publishers hear how long each component lasts.

>>> AGAIN
10.0
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from evertwin.config import TwinSpec
from evertwin.errors import EvertwinError
from evertwin.fold import Block
from evertwin.prognosis import alarmed
from evertwin.prognosis.histories.believed import WEIGHS
from evertwin.service.twin.questions import beside, planned, reading

if TYPE_CHECKING:
    from evertwin.service.twin.runner import Runner

LOG = logging.getLogger("evertwin.service")
AGAIN = 10.0
"""Seconds from one look for new values to the next."""


async def tell_lives(runner: Runner) -> None:
    """Tells of lives whenever something new is known of them; what cannot be told is tried again
    with the next value."""
    known, why = (0, 0), ""
    while True:
        await asyncio.sleep(AGAIN)
        work = runner.work
        weighs = max((n for n, event in runner.events if event["kind"] in WEIGHS), default=0)
        if work is None or (work.estimates, weighs) == known:
            continue
        known = work.estimates, weighs
        try:
            await runner.lives(await beside(runner, lived))
        except EvertwinError as error:
            if str(error) != why:
                LOG.warning("%s: lives are not told: %s", runner.name, error)
            why = str(error)


def lived(spec: TwinSpec, blocks: Sequence[Block]) -> Mapping[str, Any]:
    """How long the components last (``life``), and the ``events`` that the log does not have."""
    with reading(spec) as twin:
        lives = twin.prospect(None, blocks[-1]).lives()
        lives, events = alarmed(twin.store, lives, spec.prognosis)
        return {"life": {**lives.to_dict(), "plan": planned(twin, blocks[-1])}, "events": events}
