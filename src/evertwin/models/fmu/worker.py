"""The supervisor of a child process that holds one FMU.

Native code from elsewhere may crash, hang, call ``exit`` or take all memory. It therefore lives in
a process of its own, without this one's files and environment, with limits on memory, processor
time and wall-clock time per row. Loops over rows run there whole, so a block costs one message.

Where the child breaks down in a row, a fresh one does the call again with that row failed: it is
NaN, the rows before and after it are not. A child that breaks down again and again is given up,
and every row fails from then on; the twin runs on either way.
"""

from __future__ import annotations

import json
import logging
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.errors import ModelError, UsageError
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.guard import Unpacking, opened, unpack
from evertwin.models.fmu.memory import DATA, TEXT, TEXT_SIZE, Shared
from evertwin.models.kernel import Layer

__all__ = ["Fault", "Limits", "Worker"]

log = logging.getLogger("evertwin")
_POLL = 0.02
_ROOM = 1 << 20
_REPLY = 24
_KEPT = ("PATH", "HOME", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "NUMBA_CACHE_DIR", "PYTHONPATH")
"""What the child sees of the environment: no secrets."""
_TRIES = 3
"""Break-downs in one call before the rest of its rows fail."""
_HEALED = 1000
"""Rows in a row that make up for all break-downs before them."""
_STATUS = {
    at.DISCARD: "fmi Discard", at.ERROR: "fmi Error", at.PENDING: "fmi Pending",
    at.NOT_FINITE: "a result that is not finite", at.TOO_MANY: "too many steps in a row",
    at.ENDED: "the wish to end the simulation", at.TOO_LARGE: "a saved state that grew",
}  # fmt: skip


@dataclass(frozen=True)
class Limits:
    """What an FMU may take.

    >>> Limits().row_seconds
    5.0
    """

    row_seconds: float = 5.0
    """Wall-clock time of one row."""
    start_seconds: float = 30.0
    """Wall-clock time to load and initialise."""
    cpu_seconds: float = 600.0
    """Processor time of one call: a block of rows."""
    memory: int = 1_000_000_000
    """Address space beside the bare interpreter's [bytes]."""
    faults: int = 8
    """Break-downs after which the FMU is given up; a thousand good rows make up for them."""
    unpacking: Unpacking = Unpacking()

    def __post_init__(self) -> None:
        numbers = self.row_seconds, self.start_seconds, self.cpu_seconds, self.memory, self.faults
        if not all(number > 0 for number in numbers):
            raise UsageError(f"limits of the FMU: expected numbers above 0, got {numbers}")


@dataclass(frozen=True)
class Fault:
    """One break-down or failed row.

    >>> Fault("crashed", "SIGSEGV", 3, 0.01).kind
    'crashed'
    """

    kind: str
    """crashed, exited, hung, fatal, start, failed (rows whose status was no success)."""
    detail: str
    row: int
    """Step of the call, from 0; −1: outside of a step."""
    seconds: float
    """From the begin of the step (of the call, where it crashed) to the moment it was known."""


class Worker:
    """See the module. `Fmu` owns one and starts it.

    >>> Worker.__name__
    'Worker'
    """

    def __init__(self, package: Path, plan: Mapping[str, Any], limits: Limits) -> None:
        self.package, self.plan, self.limits = package, dict(plan), limits
        self.faults: list[Fault] = []
        self.page = np.zeros(0, dtype=np.int64)
        """What `slots.layout` gave; set before the first call."""
        self._start_values: list[float] = list(plan["parameter_values"])
        self._lock = threading.RLock()
        self._forget()

    def _forget(self) -> None:
        self._owner = os.getpid()
        self._process: subprocess.Popen[bytes] | None = None
        self._shared: Shared | None = None
        self._folder: Path | None = None
        self._told = self._broken = 0
        self._end: Any = None
        self._tidy: Any = None
        self._dead = False
        self._page: Any = None
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
        with self._lock:
            try:
                return self._start()
            except _BrokenDown as error:
                self._stop()
                raise ModelError(f"{self.package.name}: {error}") from error

    def _start(self) -> int:
        if self._owner != os.getpid():
            self._forget()
        if self._folder is None:
            self._unpack()
        self._shared = Shared(_ROOM)
        orders, sending = os.pipe()
        replies, answering = os.pipe()
        files = orders, answering, self._shared.file
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "evertwin.models.fmu.child", *map(str, files),
             str(self.limits.memory)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            pass_fds=files, start_new_session=True, cwd=self._folder,
            env={**{k: v for k, v in os.environ.items() if k in _KEPT}, "PYTHONPATH": _path()},
        )  # fmt: skip
        os.close(orders)
        os.close(answering)
        self._orders, self._replies = sending, replies
        self._end = weakref.finalize(
            self, _end, os.getpid(), self._process, (sending, replies), self._memory
        )
        self._page = None
        order = {"do": "load", "plan": {**self.plan, "folder": str(self._folder)},
                 "parameters": self._start_values}  # fmt: skip
        size, _ = self._ask(order, self.limits.start_seconds)
        if len(self.page):
            self._attach()
        return size

    def _unpack(self) -> None:
        folder = Path(tempfile.mkdtemp(prefix="evertwin-fmu-"))
        limits = self.limits.unpacking
        wanted = ("modelDescription.xml", "resources/", f"binaries/{self.plan['platform']}/")
        try:
            with opened(self.package, limits) as archive:
                unpack(archive, folder, self.package.name, limits, wanted)
        except ModelError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        (folder / "resources").mkdir(exist_ok=True)
        self._folder, self._tidy = folder, weakref.finalize(self, _remove, os.getpid(), folder)

    def attach(self, page: np.ndarray) -> None:
        """Sets the page that rows are run by.

        Raises:
            ModelError: the child breaks down.
        """
        with self._lock:
            self.page = page
            try:
                self._attach()
            except _BrokenDown as error:
                raise ModelError(f"{self.package.name}: {error}") from error

    def _attach(self) -> None:
        shared = self._memory
        place = shared.reserve(self.page)
        self._page = shared.array(place, np.int64, len(self.page))
        order = {"do": "page", "offset": place, "words": len(self.page)}
        self._ask(order, self.limits.start_seconds)

    @property
    def _memory(self) -> Shared:
        assert self._shared is not None
        return self._shared

    def close(self) -> None:
        """Ends the child and removes the unpacked files; a later call starts it again."""
        with self._lock:
            self._stop()
            if self._folder is not None and self._owner == os.getpid():
                self._tidy()
            self._folder = None

    def _stop(self) -> None:
        if self._process is not None and self._owner == os.getpid():
            _kill(self._process)
            if self._end is not None:
                self._end.detach()
            for file in (self._orders, self._replies):
                os.close(file)
            self._memory.close()
        self._process, self._page, self._shared = None, None, None

    def _ready(self) -> None:
        """A running child with its page.

        Raises:
            _BrokenDown: it does not start.
        """
        if self._owner != os.getpid():
            self._forget()
        if self._process is None:
            self._start()

    # ------------------------------------------------------------------ talking

    def _ask(self, order: Mapping[str, Any], seconds: float) -> tuple[int, float]:
        """One order and its reply.

        Raises:
            _BrokenDown: the child ended or hangs; it is gone.
        """
        began = time.perf_counter()
        try:
            os.write(self._orders, json.dumps(order, separators=(",", ":")).encode() + b"\n")
            self._wait(began, seconds)
            reply = os.read(self._replies, _REPLY)
        except BrokenPipeError:
            reply = b""
        if len(reply) != _REPLY:
            raise self._ended(time.perf_counter() - began)
        numbers = np.frombuffer(reply, np.int64, 2)
        return int(numbers[1]), float(np.frombuffer(reply, np.float64, 1, 16)[0])

    def _wait(self, began: float, seconds: float) -> None:
        """Until the reply or the end is there, or a row takes too long."""
        count, since, page = -1, began, self._page
        while not select.select([self._replies], [], [], _POLL)[0]:
            now = time.perf_counter()
            inside = page is not None and bool(page[at.INSIDE])
            if inside and int(page[at.COUNT]) != count:
                count, since = int(page[at.COUNT]), now
            if now - (since if inside else began) > seconds:
                assert self._process is not None
                _kill(self._process)
                row = int(page[at.COUNT]) - 1 if inside and page is not None else -1
                raise _BrokenDown(Fault("hung", f"no end after {seconds:g} s", row, now - since))
            if not inside and page is not None and int(page[at.COUNT]) != count:
                count, began = int(page[at.COUNT]), now

    def _ended(self, seconds: float) -> _BrokenDown:
        assert self._process is not None
        code = self._process.wait(timeout=10)
        page = self._page
        row = int(page[at.COUNT]) - 1 if page is not None and page[at.INSIDE] else -1
        if code < 0:
            cpu = " (processor time used up)" if -code == signal.SIGXCPU else ""
            return _BrokenDown(Fault("crashed", f"{signal.Signals(-code).name}{cpu}", row, seconds))
        if code == at.EXIT_FATAL:
            return _BrokenDown(Fault("fatal", "fmi Fatal", row, seconds))
        if code == at.EXIT_LIBRARY:
            return _BrokenDown(
                Fault("start" if row < 0 else "crashed", self._words(), row, seconds)
            )
        return _BrokenDown(Fault("exited", f"exit code {code}", row, seconds))

    def _words(self) -> str:
        view = self._memory.view
        size = int.from_bytes(view[TEXT : TEXT + 8], "little", signed=True)
        raw = view[TEXT + 8 : TEXT + 8 + min(max(size, 0), TEXT_SIZE - 8)]
        return raw.decode("utf-8", "replace")

    # ------------------------------------------------------------------ calls

    def initial(self, p: np.ndarray) -> np.ndarray:
        """State after initialising with ``p``, (nx,); the last good one where that breaks down.

        Raises:
            ModelError: it breaks down, and never went well before.
        """
        known = self._initials.get(p.tobytes())
        if known is not None and self._owner == os.getpid():
            return known.copy()
        x = np.zeros(int(self.page[at.NX]))
        with self._lock:
            try:
                self._ready()
                p_at, x_at = self._memory.put([np.array(p), x])
                self._page[at.COUNT] = 0
                self._ask({"do": "initial", "p": p_at, "x": x_at}, self.limits.start_seconds)
                self._memory.fetch()
            except _BrokenDown as error:
                self._note(error.fault)
                self._stop()
                if not self._initials:
                    raise ModelError(f"{self.package.name}: no initial state: {error}") from error
                return next(reversed(self._initials.values())).copy()
        if len(self._initials) >= 64:
            self._initials.pop(next(iter(self._initials)))
        self._initials[p.tobytes()] = x.copy()
        return x

    def takes_states(self, p: np.ndarray, x: np.ndarray) -> bool:
        """Does the FMU start at the states that it is given?

        Raises:
            ModelError: it breaks down.
        """
        with self._lock:
            try:
                self._ready()
                p_at, x_at = self._memory.put([np.array(p), np.array(x)])
                order = {"do": "takes", "p": p_at, "x": x_at}
                return bool(self._ask(order, self.limits.start_seconds)[0])
            except _BrokenDown as error:
                self._stop()
                raise ModelError(f"{self.package.name}: {error}") from error

    def run(
        self, loop: Callable[..., Any], layers: Sequence[Layer], arguments: Sequence[Any]
    ) -> tuple[bool, Any]:
        """The loop, in the child; see `evertwin.models.kernel.Remote`."""
        with self._lock:
            skip: list[int] = []
            while not self._dead:
                start = -1 if len(skip) <= _TRIES else skip[-1]
                try:
                    return True, self._run(loop, layers, arguments, (skip, start))
                except _BrokenDown as error:
                    self._note(error.fault)
                    self._stop()
                    if error.fault.row >= 0:
                        skip.append(error.fault.row)
                    elif self._broken > _TRIES:
                        self._dead = True
        return False, None

    def _run(
        self, loop: Any, layers: Sequence[Layer], arguments: Sequence[Any],
        failed: tuple[list[int], int],
    ) -> Any:  # fmt: skip
        self._ready()
        shared = self._memory
        # copies: the child puts its own addresses in, which must not come back
        everything = [*(layer.plan.copy() for layer in layers), *arguments]
        need = shared.base + shared.need(everything) + DATA
        if need > len(shared.view):
            shared.grow(2 * need)
            self._ask({"do": "map"}, self.limits.start_seconds)
        places = shared.put(everything)
        page = self._page
        page[[at.COUNT, at.BAD, at.STATUS, at.INSIDE]] = 0
        page[at.SKIP : at.SKIP + at.SKIPS] = -1
        page[at.SKIP : at.SKIP + len(failed[0])] = failed[0]
        page[at.FROM] = failed[1]
        whole, _ = self._ask(
            {"do": "loop", "module": loop.__module__, "name": loop.__name__,
             "layers": [[layer.module, where] for layer, where in zip(layers, places)],
             "arguments": places[len(layers) :], "seconds": self.limits.cpu_seconds},
            self.limits.row_seconds,
        )  # fmt: skip
        shared.fetch()
        self._account()
        return whole

    def _account(self) -> None:
        """Failed rows that left the child alive, and the way back to health."""
        page = self._page
        rows, bad, status = int(page[at.COUNT]), int(page[at.BAD]), int(page[at.STATUS])
        if bad and status in _STATUS:
            detail = f"{bad} of {rows} rows ended with {_STATUS[status]}"
            self._tell(Fault("failed", detail, int(page[at.FIRST]), 0.0))
        elif not bad and rows >= _HEALED:
            self._broken = 0

    def _note(self, fault: Fault) -> None:
        self._tell(fault)
        self._broken += 1
        if self._broken >= self.limits.faults:
            self._dead = True

    def _tell(self, fault: Fault) -> None:
        log.warning("%s: %s", self.package.name, _sentence(fault))
        self.faults.append(fault)

    def news(self) -> tuple[str, ...]:
        """Faults since the last call, one sentence each."""
        new = self.faults[self._told :]
        self._told = len(self.faults)
        texts = [f"{self.package.name}: {_sentence(fault)}" for fault in new]
        if self._dead and new:
            texts.append(f"{self.package.name}: given up; every row fails until the next start")
        return tuple(texts)


class _BrokenDown(RuntimeError):
    """The child is gone; never leaves this module."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(_sentence(fault))
        self.fault = fault


def _sentence(fault: Fault) -> str:
    where = f" in step {fault.row} of a block" if fault.row >= 0 else ""
    return f"the FMU {fault.kind}{where}: {fault.detail} (known after {fault.seconds:.3g} s)"


def _again(package: Path, plan: Mapping[str, Any], limits: Limits, page: np.ndarray) -> Worker:
    worker = Worker(package, plan, limits)
    worker.page = page
    return worker


def _path() -> str:
    """Where the child finds the same packages."""
    return os.pathsep.join(entry for entry in sys.path if entry)


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Ends the child and all that it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait(timeout=10)


def _end(
    owner: int, process: subprocess.Popen[bytes], files: tuple[int, int], shared: Shared
) -> None:
    """When the worker is collected or the interpreter ends; not in a process forked from it."""
    if owner == os.getpid():
        _kill(process)
        for file in files:
            os.close(file)
        shared.close()


def _remove(owner: int, folder: Path) -> None:
    if owner == os.getpid():
        shutil.rmtree(folder, ignore_errors=True)
