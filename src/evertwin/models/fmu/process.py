"""One child process with its shared memory, and the talk with it.

It gets three open files and a short list of environment variables, its own session, and no more.
Whether it hangs is read from the page that both map: the step it is in, and since when. What both
run is compiled before a child's time begins: the first time takes half a minute on a busy machine.

>>> Process.__name__
'Process'
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.models.fmu import kernels  # noqa: F401 - compiled and cached here, see below
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.faults import BrokenDown, Fault
from evertwin.models.fmu.memory import TEXT, TEXT_SIZE, Shared

_POLL = 0.02
_ROOM = 1 << 20
_REPLY = 24
_GRACE = 5.0
"""Seconds that a healthy child has to end by itself."""
_KEPT = (
    "PATH", "HOME", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "NUMBA_CACHE_DIR",
    "COVERAGE_PROCESS_CONFIG",
)  # fmt: skip
"""What the child sees of the environment: no secrets."""


class Process:
    """A running child. Ends with this object, with `end`, or with this process."""

    def __init__(self, folder: Path, memory: int) -> None:
        self.shared = Shared(_ROOM)
        self.page: Any = None
        """The page that rows are run by, once `attach` put it there."""
        orders, self._orders = os.pipe()
        self._replies, answers = os.pipe()
        files = orders, answers, self.shared.file
        environment = {key: value for key, value in os.environ.items() if key in _KEPT}
        environment["PYTHONPATH"] = os.pathsep.join(entry for entry in sys.path if entry)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "evertwin.models.fmu.child", *map(str, files),
             str(memory)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            pass_fds=files, start_new_session=True, cwd=folder, env=environment,
        )  # fmt: skip
        os.close(orders)
        os.close(answers)
        self.end = weakref.finalize(
            self, _end, os.getpid(), self._process, (self._orders, self._replies), self.shared
        )
        """Ends the child and lets go of its files; a second call does nothing."""

    @property
    def number(self) -> int:
        """Process id."""
        return self._process.pid

    def attach(self, page: np.ndarray, seconds: float) -> None:
        """Puts the page into shared memory.

        Raises:
            BrokenDown: the child ends or hangs.
        """
        place = self.shared.reserve(page)
        self.page = self.shared.array(place, np.int64, len(page))
        self.ask({"do": "page", "offset": place, "words": len(page)}, seconds)

    def room_for(self, values: Any, seconds: float) -> None:
        """Grows the shared memory where arguments do not fit.

        Raises:
            BrokenDown: the child ends or hangs.
        """
        need = self.shared.base + self.shared.need(values) + _REPLY
        if need > len(self.shared.view):
            self.shared.grow(2 * need)
            self.ask({"do": "map"}, seconds)

    def ask(self, order: Mapping[str, Any], seconds: float, outside: float = 0.0) -> int:
        """One order and its reply; a row may take ``seconds``, what is none ``outside`` or so.

        Raises:
            BrokenDown: the child ended or hangs; it is gone.
        """
        began = time.perf_counter()
        try:
            os.write(self._orders, json.dumps(order, separators=(",", ":")).encode() + b"\n")
            self._wait(began, seconds, outside or seconds)
            reply = os.read(self._replies, _REPLY)
        except BrokenPipeError:
            reply = b""
        if len(reply) != _REPLY:
            raise BrokenDown(self._ended(time.perf_counter() - began))
        return int(np.frombuffer(reply, np.int64, 1, 8)[0])

    def _wait(self, since: float, inside: float, outside: float) -> None:
        """Until the reply or the end is there, or no step has begun or ended for too long."""
        seen, page = (-1, False), self.page
        while not select.select([self._replies], [], [], _POLL)[0]:
            now = time.perf_counter()
            where = (-1, False) if page is None else (int(page[at.COUNT]), bool(page[at.INSIDE]))
            seconds = inside if where[1] else outside
            if where != seen:
                seen, since = where, now if seen != (-1, False) else since
            elif now - since > seconds:
                _kill(self._process)
                row = where[0] - 1 if where[1] else -1
                raise BrokenDown(Fault("hung", f"no end after {seconds:g} s", row, now - since))

    def _ended(self, seconds: float) -> Fault:
        """What the exit code says."""
        code, page = self._process.wait(timeout=10), self.page
        row = int(page[at.COUNT]) - 1 if page is not None and page[at.INSIDE] else -1
        if code < 0:
            used_up = " (processor time used up)" if -code == signal.SIGXCPU else ""
            return Fault("crashed", f"{signal.Signals(-code).name}{used_up}", row, seconds)
        if code == at.EXIT_FATAL:
            return Fault("fatal", "fmi Fatal", row, seconds)
        if code == at.EXIT_LIBRARY:
            return Fault("start" if row < 0 else "crashed", self._last_words(), row, seconds)
        return Fault("exited", f"exit code {code}", row, seconds)

    def _last_words(self) -> str:
        view = self.shared.view
        size = int.from_bytes(view[TEXT : TEXT + 8], "little", signed=True)
        raw = view[TEXT + 8 : TEXT + 8 + min(max(size, 0), TEXT_SIZE - 8)]
        return raw.decode("utf-8", "replace")


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
    """Asks the child to end, and makes it; not in a process that was forked from the owner."""
    if owner != os.getpid():
        return
    os.close(files[0])
    try:
        process.wait(timeout=_GRACE)
    except subprocess.TimeoutExpired:
        pass
    _kill(process)
    os.close(files[1])
    shared.close()
