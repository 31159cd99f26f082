"""The supervisor of a child process that holds one FMU.

Native code from elsewhere may crash, hang, call ``exit`` or take all memory. It therefore lives in
a process of its own, without this one's files and environment, with limits on memory, processor
time and wall-clock time per row. Loops over rows run there whole, so a block costs one message.

Where the child breaks down in a row, a fresh one does the call again with that row failed: it is
NaN, the rows before and after it are not. A child that breaks down again and again is given up,
and every row fails from then on; the twin runs on either way.
"""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.errors import ModelError
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.faults import STATUS, BrokenDown, Fault
from evertwin.models.fmu.guard import opened, unpack
from evertwin.models.fmu.options import Options
from evertwin.models.fmu.process import Process
from evertwin.models.kernels.kernel import Layer

log = logging.getLogger("evertwin")
_TRIES = 3
"""Break-downs in one call before the rest of its rows fail."""
_HEALED = 1000
"""Good rows in one call that make up for all break-downs before them."""
_OUTSIDE = 300.0
"""Seconds that a loop may take outside of rows: it may have to be compiled first."""
_KNOWN = 64
"""Initial states that are kept."""


class Worker:
    """See the module. `Fmu` owns one and starts it.

    >>> Worker.__name__
    'Worker'
    """

    def __init__(self, package: Path, plan: Mapping[str, Any], limits: Options) -> None:
        self.package, self.plan, self.limits = package, dict(plan), limits
        self.faults: list[Fault] = []
        self.page = np.zeros(0, dtype=np.int64)
        """What `slots.layout` gave; set before the first call."""
        self._lock = threading.RLock()
        self._forget()

    def _forget(self) -> None:
        """As new; also in a process that was forked, to which the child does not belong."""
        self._owner = os.getpid()
        self._process: Process | None = None
        self._folder: Path | None = None
        self._tidy: Any = None
        self._told = self._broken = 0
        self._dead = False
        self._initials: dict[bytes, np.ndarray] = {}

    def __reduce__(self) -> Any:
        return _again, (self.package, self.plan, self.limits, self.page)

    # ------------------------------------------------------------------ life

    @property
    def alive(self) -> bool:
        """False once the FMU has been given up."""
        return not self._dead

    def load(self) -> int:
        """Starts the child and the FMU in it: the size of its saved state [bytes].

        Raises:
            ModelError: the FMU does not load, or breaks down in it.
        """
        with self._alone():
            return self._start()

    def attach(self, page: np.ndarray) -> None:
        """Sets the page that rows are run by.

        Raises:
            ModelError: the child breaks down.
        """
        with self._alone():
            self.page = page
            self._running().attach(page, self.limits.start_seconds)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Alone with the child; a break-down ends it."""
        with self._lock:
            try:
                yield
            except BrokenDown as error:
                self._stop()
                raise ModelError(f"{self.package.name}: {error}") from error

    def close(self) -> None:
        """Ends the child and removes the unpacked files; a later call starts it again."""
        with self._lock:
            self._stop()
            if self._tidy is not None:
                self._tidy()
            self._folder = None

    def _start(self) -> int:
        if self._folder is None:
            self._unpack()
        assert self._folder is not None
        self._process = Process(self._folder, int(self.limits.memory_mb * 1e6))
        order = {
            "do": "load", "plan": {**self.plan, "folder": str(self._folder)},
            "parameters": self.plan["parameter_values"],
        }  # fmt: skip
        size = self._process.ask(order, self.limits.start_seconds)
        if len(self.page):
            self._process.attach(self.page, self.limits.start_seconds)
        return size

    def _unpack(self) -> None:
        folder = Path(tempfile.mkdtemp(prefix="evertwin-fmu-"))
        self._tidy = weakref.finalize(self, _remove, os.getpid(), folder)
        limits = self.limits.unpacking
        wanted = ("modelDescription.xml", "resources/", f"binaries/{self.plan['platform']}/")
        try:
            with opened(self.package, limits) as archive:
                unpack(archive, folder, self.package.name, limits, wanted)
        except ModelError:
            self._tidy()
            raise
        (folder / "resources").mkdir(exist_ok=True)
        self._folder = folder

    def _stop(self) -> None:
        if self._process is not None:
            self._process.end()
        self._process = None

    def _running(self) -> Process:
        """The child, started where there is none.

        Raises:
            BrokenDown: it does not start.
        """
        if self._owner != os.getpid():
            self._forget()
        if self._process is None:
            self._start()
        assert self._process is not None
        return self._process

    # ------------------------------------------------------------------ calls

    def initial(self, p: np.ndarray) -> np.ndarray:
        """State after initialising with ``p``, (nx,); the last good one where that breaks down.

        Raises:
            ModelError: it breaks down, and never went well before.
        """
        with self._lock:
            if self._owner != os.getpid():
                self._forget()
            known = self._initials.get(p.tobytes())
            if known is None and not self._dead:
                known = self._initialised(p)
            if known is None and self._initials:
                known = next(reversed(self._initials.values()))
        if known is None:
            reason = self.faults[-1] if self.faults else "it was given up"
            raise ModelError(f"{self.package.name}: no initial state: {reason}")
        return known.copy()

    def _initialised(self, p: np.ndarray) -> np.ndarray | None:
        """A fresh initial state; None where the FMU breaks down."""
        x = np.zeros(int(self.page[at.NX]))
        try:
            process = self._running()
            process.page[at.COUNT] = 0
            values, state = process.shared.put([np.array(p), x])
            process.ask({"do": "initial", "p": values, "x": state}, self.limits.start_seconds)
            process.shared.fetch()
        except BrokenDown as error:
            self._note(error.fault)
            return None
        if len(self._initials) >= _KNOWN:
            self._initials.pop(next(iter(self._initials)))
        self._initials[p.tobytes()] = x
        return x

    def takes_states(self, p: np.ndarray, x: np.ndarray) -> bool:
        """Does the FMU start at the states that it is given?

        Raises:
            ModelError: it breaks down.
        """
        with self._alone():
            process = self._running()
            values, state = process.shared.put([np.array(p), np.array(x)])
            order = {"do": "takes", "p": values, "x": state}
            return bool(process.ask(order, self.limits.start_seconds))

    def run(
        self, loop: Callable[..., Any], layers: Sequence[Layer], arguments: Sequence[Any]
    ) -> tuple[bool, Any]:
        """The loop, in the child; see `evertwin.models.kernels.kernel.Remote`."""
        with self._lock:
            lost: list[int] = []
            while not self._dead:
                try:
                    return True, self._run(loop, layers, arguments, lost)
                except BrokenDown as error:
                    self._note(error.fault)
                    if error.fault.row >= 0:
                        lost.append(error.fault.row)
                    elif self._broken > _TRIES:
                        self._dead = True
        return False, None

    def _run(
        self, loop: Any, layers: Sequence[Layer], arguments: Sequence[Any], lost: list[int]
    ) -> int:
        """One try, with the rows ``lost`` failed and, after too many, all behind the last."""
        process = self._running()
        # copies: the child puts its own addresses in, which must not come back
        everything = [*(layer.plan.copy() for layer in layers), *arguments]
        process.room_for(everything, self.limits.start_seconds)
        places, page = process.shared.put(everything), process.page
        page[[at.COUNT, at.BAD, at.STATUS, at.INSIDE]] = 0
        page[at.SKIP : at.SKIP + at.SKIPS] = -1
        page[at.SKIP : at.SKIP + len(lost)] = lost
        page[at.FROM] = lost[-1] if len(lost) > _TRIES else -1
        whole = process.ask(
            {"do": "loop", "module": loop.__module__, "name": loop.__name__,
             "layers": [[x.module, x.terms, where] for x, where in zip(layers, places)],
             "arguments": places[len(layers) :], "seconds": self.limits.cpu_seconds},
            self.limits.row_seconds, _OUTSIDE,
        )  # fmt: skip
        process.shared.fetch()
        self._account(page)
        return whole

    def _account(self, page: np.ndarray) -> None:
        """Failed rows that left the child alive, and the way back to health."""
        rows, bad, status = int(page[at.COUNT]), int(page[at.BAD]), int(page[at.STATUS])
        if bad and status in STATUS:
            detail = f"{bad} of {rows} rows ended with {STATUS[status]}"
            self._tell(Fault("failed", detail, int(page[at.FIRST]), 0.0))
        elif not bad and rows >= _HEALED:
            self._broken = 0

    # ------------------------------------------------------------------ what went wrong

    def _note(self, fault: Fault) -> None:
        """A break-down: told, counted, and the rest of the child put away."""
        self._tell(fault)
        self._stop()
        self._broken += 1
        if self._broken >= self.limits.faults:
            self._dead = True

    def _tell(self, fault: Fault) -> None:
        log.warning("%s: %s", self.package.name, fault)
        self.faults.append(fault)

    def news(self) -> tuple[str, ...]:
        """Faults since the last call, one sentence each."""
        new = self.faults[self._told :]
        self._told = len(self.faults)
        texts = [f"{self.package.name}: {fault}" for fault in new]
        if self._dead and new:
            texts.append(f"{self.package.name}: given up; every row fails until the next start")
        return tuple(texts)


def _again(package: Path, plan: Mapping[str, Any], limits: Options, page: np.ndarray) -> Worker:
    worker = Worker(package, plan, limits)
    worker.page = page
    return worker


def _remove(owner: int, folder: Path) -> None:
    """Not in a process that was forked from the owner."""
    if owner == os.getpid():
        shutil.rmtree(folder, ignore_errors=True)
