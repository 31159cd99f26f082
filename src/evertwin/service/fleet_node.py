"""A service as one node of a fleet: it runs the twins that it has a lease of, and no others.

The leases are renewed in a thread of their own, whatever the twins do. A twin whose lease is lost
is dropped at once; nothing that it would still write is taken (`evertwin.store.owners.owners`).
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

from evertwin.errors import EvertwinError, StoreUnwritable
from evertwin.fleet import FleetSpec, Members, Step, Tenure, Told, fleet_told
from evertwin.fleet.tenure import COST, STEPS, TOGETHER
from evertwin.service.site.loading import why_not
from evertwin.service.site.site_plan import Plan
from evertwin.store import SqlOwners
from evertwin.store.postgres.database import Postgres

if TYPE_CHECKING:
    from evertwin.service.service import Service
    from evertwin.service.twin.runner import Runner

LOG = logging.getLogger("evertwin.service")
SMOOTH = 300.0
"""Seconds over which the cost of a twin is measured: a fit now and then is no reason to move it."""


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
        self._looking = ThreadPoolExecutor(TOGETHER, thread_name_prefix="look")
        self._cost: dict[str, tuple[float, float, float, float]] = {}
        """By twin: since when it is measured, when last, seconds of work until then, cost."""
        self._turns: dict[str, asyncio.Lock] = {}
        """A twin is started or stopped, never both."""
        self._tasks: set[asyncio.Task[None]] = set()
        self._leaving: set[str] = set()
        self._looked_at: set[str] = set()
        """Twins of others whose states are looked at just now."""
        self._ends = False
        self._down: type[EvertwinError] | None = None
        """How the store failed that does not answer; None: it does."""

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
        for twin in [one for one, runner in runners.items() if runner.hopeless]:
            self._later(self._give_up(twin))
        for twin in set(step.look) - self._looked_at:
            self._later(self._look(twin))

    def _stepped(self, told: Mapping[str, Told]) -> Step:
        try:
            if self.tenure is None:
                database = Postgres(self.server)
                self.tenure = Tenure(
                    self._settings.name, self._settings.lease, SqlOwners(database),
                    Members(database), address=self.address,
                )  # fmt: skip
            step = self.tenure.step(told)
        except EvertwinError as error:
            if self._down is not type(error):
                LOG.error("fleet: nothing is taken: %s", error)
            self._down = type(error)
            return Step()
        if self._down is not None:
            LOG.info("fleet: the store answers again")
        self._down = None
        return step

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
                self._cost.pop(plan.name, None)
                found[plan.name] = Told(pinned=plan.entry.node, wrong=plan.wrong)
                continue
            lag = sorted(runner.folded)[len(runner.folded) // 2] if runner.folded else 0.0
            lag = max(lag, runner.stuck)  # what it is at just now may take longer than ever
            cost = round(self._measured(runner), 4)
            said = round(lag, 4), runner.row, runner.reason, plan.entry.node, plan.wrong
            found[plan.name] = Told(cost, *said)
        return found

    def _measured(self, runner: Runner) -> float:
        """What a twin costs [s/s]; at first, what it cost the node that had it before."""
        now = time.monotonic()
        work = runner.lane.worked + (0.0 if runner.work is None else runner.work.beside)
        if runner.name not in self._cost:
            known = COST if self.tenure is None else self.tenure.cost(runner.name)
            began = now if known == COST else now - SMOOTH
            self._cost[runner.name] = began, now, work, known
        began, at, before, cost = self._cost[runner.name]
        if now > at:
            weight = (now - at) / min(now - began, SMOOTH)
            cost += min(weight, 1.0) * (max(work - before, 0.0) / (now - at) - cost)
        self._cost[runner.name] = began, now, work, cost
        return cost

    def _later(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _begin(self, twin: str) -> None:
        async with self._turns.setdefault(twin, asyncio.Lock()):
            token, tenure = self.tokens.get(twin), self.tenure
            if token is None or tenure is None or twin in self._service.runners or self._ends:
                return
            found = await self._why_not(twin) if tenure.strict(twin) else ("", "")
            if found is None or self.tokens.get(twin) != token:
                return
            state, settings = found
            if state or (settings and tenure.patient(twin)):
                await self._refuse(twin, state or settings, later=not state)
                return
            LOG.info("%s: taken under token %d", twin, token, extra={"twin": twin})
            await self._service.take(twin)
            runner = self._service.runners.get(twin)
            if runner is not None and runner.state == "running" and twin in self.tokens:
                await self._in_turn(partial(tenure.began, twin))
        if runner is not None and runner.hopeless:
            await self._give_up(twin)

    async def _why_not(self, twin: str) -> tuple[str, str] | None:
        """Why this node cannot go on with a twin, and why with a new run only; None: not known."""
        plan = self._plan(twin)
        if plan is None:
            return "the site file does not name it", ""
        try:
            loop = asyncio.get_running_loop()
            return await loop.run_in_executor(self._looking, why_not, plan, self.server)
        except StoreUnwritable as error:
            LOG.warning("fleet: %s: looked at later: %s", twin, error)
            return None

    def _plan(self, twin: str) -> Plan | None:
        return next((one for one in self._service.site.twins if one.name == twin), None)

    async def _look(self, twin: str) -> None:
        """Says whether a twin of another node can come here."""
        self._looked_at.add(twin)
        try:
            tenure = self.tenure
            held = None if tenure is None else tenure.held.get(twin)
            if tenure is None or held is None:
                return
            found = await self._why_not(twin) if tenure.strict(twin) else ("", "")
            if found is not None:
                reason = found[0] or found[1]
                await self._in_turn(partial(tenure.say, twin, held.token, reason))
        finally:
            self._looked_at.discard(twin)

    async def _give_up(self, twin: str) -> None:
        """A twin that failed at its start here goes to others, with the reason."""
        async with self._turns.setdefault(twin, asyncio.Lock()):
            runner = self._service.runners.get(twin)
            if runner is not None and runner.hopeless and self.tokens.get(twin) == runner.token:
                del self._service.runners[twin]
                await runner.stop()
                await self._refuse(twin, runner.reason)

    async def _refuse(self, twin: str, reason: str, *, later: bool = False) -> None:
        LOG.warning("%s: left to other nodes: %s", twin, reason, extra={"twin": twin})
        if self.tenure is not None and twin in self.tokens:
            await self._in_turn(partial(self.tenure.refuse, twin, reason, later=later))

    async def _in_turn(self, work: Callable[[], None]) -> None:
        """Something of the tenure, in its thread."""

        def done() -> None:
            try:
                work()
            except StoreUnwritable as error:
                LOG.warning("fleet: %s", error)

        await asyncio.get_running_loop().run_in_executor(self._thread, done)

    def again(self) -> None:
        """The files were read anew: what could not be gone on with is tried again."""
        if self.tenure is not None:
            self.tenure.again()

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
                await self._in_turn(partial(self.tenure.release, twin))
        self._leaving.discard(twin)

    async def rest(self) -> None:
        """Nothing more is taken; what was begun is done."""
        self._ends = True
        await asyncio.gather(*self._tasks)

    async def end(self) -> None:
        """Every twin was stopped: others may have them at once."""
        if self.tenure is not None:
            await asyncio.get_running_loop().run_in_executor(self._thread, self.tenure.end)
        self._thread.shutdown(wait=False)
        self._looking.shutdown(wait=False)

    async def status(self) -> dict[str, Any]:
        """The fleet as the store knows it: nodes, and who has which twin.

        Raises:
            StoreUnwritable: the store cannot be reached.
        """
        tenure = self.tenure
        if tenure is None:
            raise StoreUnwritable("the shared store was not reached yet")
        pins = {plan.name: plan.entry.node for plan in self._service.site.twins}
        asked = partial(fleet_told, tenure.owners, tenure.members, tenure.lease, pins)
        found = await asyncio.get_running_loop().run_in_executor(self._thread, asked)
        return {"node": self._settings.name, **found}
