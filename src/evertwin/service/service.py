"""All twins of a site in one process: start, reload, stop.

A reload takes the site file and the twin files anew: twins that are gone are stopped, new ones are
started, changed ones are stopped and started, the others never notice. A file that cannot be read,
or of which no twin can be built, changes nothing, and the error is told.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from evertwin.engine import Pool
from evertwin.errors import ConfigError, UsageError, nearest
from evertwin.refit import work_of
from evertwin.service.fleet_node import Tending
from evertwin.service.logs import Newest
from evertwin.service.loop_lag import Lag
from evertwin.service.site.loading import why_not
from evertwin.service.site.site_plan import Plan, Site, read_site
from evertwin.service.systemd import beat_of, notify
from evertwin.service.twin.process import Process
from evertwin.service.twin.runner import Runner
from evertwin.service.twin.warming import Beside, before

LOG = logging.getLogger("evertwin.service")
BEAT = 1.0
"""Seconds between two looks at everything."""
RESTART = ("address", "port", "certificate", "key", "connections", "timeout")
"""Settings of [http] that hold from the next start on."""


class Service:
    """The twins of a site file.

    >>> Service.__name__
    'Service'
    """

    def __init__(self, path: Path) -> None:
        """Reads the site file.

        Raises:
            ConfigError: it does not say what it must.
        """
        self.path = path
        self.site: Site = read_site(path)
        self._started = self.site.spec
        """What holds until the next start."""
        self.runners: dict[str, Runner] = {}
        self.process = Process(self.runners)
        self.lag = Lag()
        self.began = time.time()
        self.ready = False
        self.reloads = 0
        self.error = ""
        """Why the newest reload changed nothing."""
        self.log = Newest()
        fleet = self.site.spec.fleet
        self.tending = Tending(self, fleet) if fleet.store else None
        """As one node of several; None: all twins are this process's."""
        self._turn = asyncio.Lock()
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Starts every twin; ready when each runs or is in quarantine."""
        logging.getLogger("evertwin").addHandler(self.log)
        self.site.store.mkdir(parents=True, exist_ok=True)
        self._tasks = [asyncio.create_task(self.lag.watch()), asyncio.create_task(self._beat())]
        if self.site.spec.warm == "beside":
            beside = Beside([plan.spec for plan in self.site.twins if plan.spec is not None])
            self.process.warm = beside.wait
            self._tasks.append(asyncio.create_task(beside.run()))
        elif self.site.spec.warm:
            self.process.warm = before
        await self._follow(self.site)
        if self.tending is not None:
            await self.tending.step()
            self._tasks.append(asyncio.create_task(self.tending.watch()))
        self.ready = True
        notify("READY=1")
        bad = [one.name for one in self.runners.values() if one.state == "quarantined"]
        LOG.info("ready: %d twins, quarantined: %s", len(self.runners), ", ".join(bad) or "none")

    async def _follow(self, site: Site) -> dict[str, list[str]]:
        """What runs becomes what the site says."""
        wanted = {plan.name: plan for plan in site.twins if self._own(plan.name)}
        gone = [
            runner for name, runner in self.runners.items()
            if wanted.get(name) != runner.plan or runner.state == "quarantined"
            or runner.store != self._store(site)
        ]  # fmt: skip
        await asyncio.gather(*(runner.stop() for runner in gone))
        shares = [plan.spec for plan in site.twins if plan.spec and plan.entry.workers is None]
        if self.process.pool is None and shares:
            count = site.spec.workers or os.cpu_count() or 1
            self.process.pool = Pool(count, warm=partial(work_of, shares[0], None))
        for runner in gone:
            self.runners.pop(runner.name, None)
        self.site = site
        fresh = [self._runner(plan) for name, plan in wanted.items() if name not in self.runners]
        before = {runner.name: runner for runner in gone}
        for one in fresh:
            if one.name in before:
                one.carry(before[one.name])
        self.runners |= {runner.name: runner for runner in fresh}
        await asyncio.gather(*(runner.start() for runner in fresh))
        return {
            "stopped": [one.name for one in gone if one.name not in wanted],
            "started": [one.name for one in fresh],
        }

    def _own(self, twin: str) -> bool:
        """Is it this process that runs a twin?"""
        return self.tending is None or twin in self.tending.tokens

    def _store(self, site: Site) -> Path | str:
        return site.store if self.tending is None else self.tending.server

    def _runner(self, plan: Plan) -> Runner:
        token = None if self.tending is None else self.tending.tokens[plan.name]
        return Runner(plan, self._store(self.site), self.process, token)

    async def take(self, twin: str) -> None:
        """Starts a twin that has become this node's."""
        for plan in self.site.twins:
            if plan.name == twin:
                self.runners[twin] = runner = self._runner(plan)
                await runner.start()

    async def reload(self) -> Mapping[str, Any]:
        """Takes the files anew; what changed.

        Raises:
            ConfigError: they cannot be read; everything stays as it was.
        """
        async with self._turn:
            try:
                site = await asyncio.to_thread(read_site, self.path)
                await asyncio.to_thread(self._refuse, site)
            except ConfigError as error:
                self.error = str(error)
                LOG.error("reload: nothing is changed: %s", error)
                raise
            old, new = self._started.http, site.spec.http
            later = [key for key in RESTART if getattr(old, key) != getattr(new, key)]
            later += ["fleet"] if self._started.fleet != site.spec.fleet else []
            told: dict[str, Any] = await self._follow(site)
            if self.tending is not None:
                self.tending.again()
            self.error, self.reloads = "", self.reloads + 1
            LOG.info("reloaded: %s", told)
            return {**told, "after_restart": later}

    def _refuse(self, site: Site) -> None:
        """A twin file that was taken, or is new, and has a mistake now changes nothing either.

        Raises:
            ConfigError: one line for each problem.
        """
        before = {plan.name: plan for plan in self.site.twins}
        failed = {one.plan.file for one in self.runners.values() if one.state == "quarantined"}
        failed |= {plan.file for plan in before.values() if plan.wrong}
        wrong = [
            why if plan.file.name in why else f"{plan.file}: {why}"
            for plan in site.twins
            if plan.file not in failed and plan != before.get(plan.name)
            for why in (plan.wrong if self.tending is not None else why_not(plan)[0],)
            if why
        ]
        if wrong:
            raise ConfigError("\n".join(wrong))

    async def stop(self) -> None:
        """Stops every twin; their states are kept."""
        notify("STOPPING=1")
        self.ready = False
        for task in self._tasks:
            task.cancel()
        if self.tending is not None:
            await self.tending.rest()
        await asyncio.gather(*(runner.stop() for runner in self.runners.values()))
        if self.tending is not None:
            await self.tending.end()
        if self.process.pool is not None:
            await asyncio.to_thread(self.process.pool.close)
        LOG.info("stopped")
        logging.getLogger("evertwin").removeHandler(self.log)

    def runner(self, name: str) -> Runner:
        """One twin.

        Raises:
            UsageError: there is none of this name.
        """
        if name not in self.runners:
            raise UsageError(f"no twin {name!r}; {nearest(name, self.runners)}")
        return self.runners[name]

    async def _beat(self) -> None:
        beat = beat_of()
        while True:
            await asyncio.sleep(BEAT if beat is None else min(BEAT, beat))
            notify("WATCHDOG=1")
            for runner in tuple(self.runners.values()):
                runner.beat()
                runner.watch()
                if runner.due is not None and runner.due < time.monotonic():
                    runner.due = None
                    self._tasks.append(asyncio.create_task(self._anew(runner)))
            self._tasks = [task for task in self._tasks if not task.done()]

    async def _anew(self, runner: Runner) -> None:
        """A twin whose store could not be written is tried again; its sources go on from there."""
        async with self._turn:
            if self.runners.get(runner.name) is runner and self.ready:
                await runner.stop()
                self.runners[runner.name] = fresh = runner.anew()
                await fresh.start()

    def status(self) -> dict[str, Any]:
        """How the service is, in plain values."""
        return {
            "schema": "evertwin.service/1", "site": self.site.spec.name, "ready": self.ready,
            "fleet": self.tending is not None, "began": self.began, "reloads": self.reloads,
            "error": self.error,
            "lag": {"p99": self.lag.share(0.99), "worst": self.lag.worst},
            "twins": [runner.status() for runner in self.runners.values()],
        }  # fmt: skip
