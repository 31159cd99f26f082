"""A machine's life: it advances by its pace, speaks, and listens to orders until it is stopped.

What is told from outside comes by `evertwin.worlds.live.control`; what was planned before comes at
its time: ``60:friction.2=1.3``.

>>> Planned.of("60:friction.2=1.3 for=20")
Planned(at=60.0, orders='friction.2=1.3 for=20')
"""

from __future__ import annotations

import asyncio
import math
import signal
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from evertwin.errors import UsageError
from evertwin.worlds.live.contract import Machine, Sample
from evertwin.worlds.live.control import Control
from evertwin.worlds.live.pace import Pace
from evertwin.worlds.live.voices.voices import Voice

BEHIND = 0.5
"""Seconds that a machine may be late before its clock is no longer held to ours."""
LOOK = 0.1
"""Seconds after which an order for another pace is heeded at the latest."""


class Planned(NamedTuple):
    """Orders for a time. See the module for an example."""

    at: float
    """Seconds of the machine's clock."""
    orders: str

    @classmethod
    def of(cls, text: str) -> Planned:
        """``SECONDS:ORDERS``.

        Raises:
            UsageError: it has another form.
        """
        at, sign, orders = text.partition(":")
        try:
            seconds = float(at)
        except ValueError:
            seconds = math.nan
        if not sign or not math.isfinite(seconds):
            raise UsageError(f"expected SECONDS:ORDERS, such as 60:payload=2, got {text!r}")
        return cls(seconds, orders)


class Samples:
    """The samples of a machine until ``seconds`` of its clock, with what is planned on the way.

    >>> hasattr(Samples, "__iter__")
    True
    """

    def __init__(self, machine: Machine, seconds: float, planned: Sequence[Planned]) -> None:
        self._machine, self._seconds = machine, seconds
        self._planned = sorted(planned)

    def __iter__(self) -> Samples:
        return self

    def __next__(self) -> list[Sample]:
        machine = self._machine
        if machine.clock >= self._seconds:
            raise StopIteration
        while self._planned and self._planned[0].at <= machine.clock:
            machine.knobs.tell(self._planned.pop(0).orders, machine.clock)
        return machine.advance()


class Life:
    """A machine that runs and speaks. ``start``: of its clock (Unix) [s]; None: the next
    full second, once it can speak.

    >>> hasattr(Life, "run")
    True
    """

    def __init__(self, machine: Machine, voice: Voice, start: float | None) -> None:
        self._machine, self._voice, self._given = machine, voice, start
        self._start = 0.0
        self._turning: set[asyncio.Task[None]] = set()

    async def run(
        self, samples: Samples, port: int, ready: Callable[[dict[str, str], float], None]
    ) -> None:
        """Runs to the end of the samples or a signal; ``ready`` is told what is reached where, and
        the start of the clock."""
        loop, running = asyncio.get_running_loop(), asyncio.current_task()
        assert running is not None
        for one in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(one, running.cancel)
        control = Control(self._machine, self._told)
        try:
            told = await self._voice.open()
            told["control"] = f"127.0.0.1:{await control.open(port)}"
            now = time.time()
            self._start = float(math.ceil(now)) if self._given is None else self._given
            late = now - self._start if self._given is None else 0.0  # stamps are the wall's
            self._pace = Pace(self._machine.knobs.of("speed"), 0.0, loop.time() - late)
            ready(told, self._start)
            await self._speak(samples)
        except asyncio.CancelledError:
            pass  # stopped from outside: it ends in order
        finally:
            await control.close()
            await self._voice.close()

    async def _speak(self, samples: Samples) -> None:
        loop = asyncio.get_running_loop()
        for several in samples:
            late = loop.time() - self._pace.due(several[0].t)
            if late > BEHIND:
                self._pace.slip(several[0].t, loop.time())
            await asyncio.sleep(0.0)
            while (early := self._pace.due(several[0].t) - loop.time()) > 0.0:
                await asyncio.sleep(min(early, LOOK))
            for one in several:
                await self._voice.say(one._replace(t=self._start + one.t))
            self._told()  # what was planned, or lasted long enough

    def _told(self) -> None:
        """Follows the knobs that are not of the machine itself: its pace, its cables."""
        knobs = self._machine.knobs
        if knobs.of("speed") != self._pace.speed:
            self._pace.change(knobs.of("speed"), asyncio.get_running_loop().time())
        for name, cable in self._voice.cables.items():
            cut, mute = bool(knobs.of("cut", name)), bool(knobs.of("mute", name))
            if (cut, mute) != (not cable.whole, cable.muted):
                task = asyncio.ensure_future(cable.turn(cut=cut, mute=mute))
                self._turning.add(task)
                task.add_done_callback(self._turning.discard)
