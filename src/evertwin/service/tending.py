"""A service as one node of a fleet: it runs the twins that it has a lease of, and no others.

The leases are renewed in a thread of their own, whatever the twins do. A twin whose lease is lost
is dropped at once; nothing that it would still write is taken (`evertwin.store.owners`).
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

from evertwin.errors import EvertwinError, StoreUnwritable
from evertwin.fleet import FleetSpec, Members, Step, Tenure, fleet_told
from evertwin.fleet.tenure import COST, STEPS, Told
from evertwin.store import SqlOwners
from evertwin.store.postgres import Postgres

if TYPE_CHECKING:
    from evertwin.service.service import Service

LOG = logging.getLogger("evertwin.service")
SMOOTH = 60.0
"""Seconds over which the cost of a twin is measured."""


class Tending:
    """One node. See the module.

    >>> Tending.__name__
    'Tending'
    """

    def __init__(self, service: Service, settings: FleetSpec) -> None:
        self._service = service
        self._settings = settings
        self.address = ""
        """Where this node's service is reached."""
        self.tenure: Tenure | None = None
        """None: the store was not reached yet."""
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="fleet")
        self._cost: dict[str, tuple[float, float, float]] = {}
        """By twin: when it was measured last, seconds of work until then, cost."""
        self._turns: dict[str, asyncio.Lock] = {}
        """A twin is started or stopped, never both."""
        self._tasks: set[asyncio.Task[None]] = set()
        self._leaving: set[str] = set()
        self._ends = False

    @property
    def server(self) -> str:
        """The shared store."""
        return self._settings.store

    @property
    def tokens(self) -> Mapping[str, int]:
        """Of the twins that this node has."""
        return {} if self.tenure is None else dict(self.tenure.tokens)

    async def watch(self) -> None:
        """Step after step, until it is cancelled."""
        while True:
            await self.step()
            await asyncio.sleep(self._settings.lease / STEPS)

    async def step(self) -> None:
        """One step of the tenure, and what follows from it."""
        pause, loop = self._settings.lease / STEPS, asyncio.get_running_loop()
        asked = loop.run_in_executor(self._thread, self._stepped, self._told())
        while not (await asyncio.wait({asked}, timeout=pause))[0]:
            self._watch_out()
        step, runners = asked.result(), self._service.runners
        for twin, runner in tuple(runners.items()):
            if self.tokens.get(twin) != runner.token:
                self._later(self._drop(twin))
        for twin in set(step.leave) - self._leaving:
            self._later(self._leave(twin))
        for twin in self.tokens.keys() - runners.keys():
            self._later(self._begin(twin))

    def _stepped(self, told: Mapping[str, Told]) -> Step:
        try:
            if self.tenure is None:
                database = Postgres(self.server)
                self.tenure = Tenure(
                    self._settings.name, self._settings.lease, SqlOwners(database),
                    Members(database), address=self.address,
                )  # fmt: skip
            return self.tenure.step(told)
        except StoreUnwritable as error:
            LOG.error("fleet: %s", error)
        except EvertwinError as error:
            LOG.error("fleet: nothing is taken: %s", error)
        return Step()

    def _watch_out(self) -> None:
        """The store does not answer: what is no longer surely this node's is dropped meanwhile."""
        for twin, runner in tuple(self._service.runners.items()):
            if self.tenure is not None and not self.tenure.sure(twin) and runner.work is not None:
                self._later(self._drop(twin))

    def _told(self) -> dict[str, Told]:
        """What this node says of its twins."""
        found = {}
        for plan in self._service.site.twins:
            runner = self._service.runners.get(plan.name)
            if runner is None:
                found[plan.name] = Told(pinned=plan.entry.node)
                continue
            now = time.monotonic()
            at, worked, cost = self._cost.get(plan.name, (now, runner.worked, COST))
            if now > at:
                weight = min((now - at) / SMOOTH, 1.0)
                cost += weight * (max(runner.worked - worked, 0.0) / (now - at) - cost)
            self._cost[plan.name] = now, runner.worked, cost
            lag = sorted(runner.folded)[len(runner.folded) // 2] if runner.folded else 0.0
            found[plan.name] = Told(
                round(cost, 4), round(lag, 4), runner.row, runner.reason, plan.entry.node
            )
        return found

    def _later(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _begin(self, twin: str) -> None:
        async with self._turns.setdefault(twin, asyncio.Lock()):
            token = self.tokens.get(twin)
            if token is not None and twin not in self._service.runners and not self._ends:
                LOG.info("%s: taken under token %d", twin, token, extra={"twin": twin})
                await self._service.take(twin)

    async def _drop(self, twin: str) -> None:
        async with self._turns.setdefault(twin, asyncio.Lock()):
            runner, tenure = self._service.runners.get(twin), self.tenure
            if runner is None or tenure is None:
                return
            if self.tokens.get(twin) != runner.token or not tenure.sure(twin):
                del self._service.runners[twin]
                await runner.abandon("its lease could not be renewed: others may have it")

    async def _leave(self, twin: str) -> None:
        self._leaving.add(twin)
        async with self._turns.setdefault(twin, asyncio.Lock()):
            runner = self._service.runners.pop(twin, None)
            if runner is not None:
                await runner.stop()
            if self.tenure is not None and twin in self.tokens:
                await asyncio.get_running_loop().run_in_executor(self._thread, self._release, twin)
        self._leaving.discard(twin)

    def _release(self, twin: str) -> None:
        assert self.tenure is not None
        try:
            self.tenure.release(twin)
        except StoreUnwritable as error:
            LOG.warning("fleet: %s: its lease ends by itself", error)

    async def rest(self) -> None:
        """Nothing more is taken; what was begun is done."""
        self._ends = True
        await asyncio.gather(*self._tasks)

    async def end(self) -> None:
        """Every twin was stopped: others may have them at once."""
        if self.tenure is not None:
            await asyncio.get_running_loop().run_in_executor(self._thread, self.tenure.end)
        self._thread.shutdown(wait=False)

    async def status(self) -> dict[str, Any]:
        """The fleet as the store knows it: nodes, and who has which twin.

        Raises:
            StoreUnwritable: the store cannot be reached.
        """
        tenure = self.tenure
        if tenure is None:
            raise StoreUnwritable("the shared store was not reached yet")
        asked = partial(fleet_told, tenure.owners, tenure.members, tenure.lease)
        found = await asyncio.get_running_loop().run_in_executor(self._thread, asked)
        return {"node": self._settings.name, **found}
