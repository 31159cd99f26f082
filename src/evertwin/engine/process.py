"""The outside of a worker: starts the process, gives it jobs, ends it when it exceeds its limits.

>>> from functools import partial
>>> process = Process(EngineSpec())
>>> process.run(pickle.dumps(partial(abs, -2)))
2
>>> process.end()
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from multiprocessing import Pipe
from typing import Any

from evertwin.engine.spec import EngineSpec
from evertwin.errors import UsageError, WorkLost

START = 120.0
"""Time that a process may take to start [s]."""
GRACE = 5.0
"""Time that it may take to end [s]."""


def packed(job: Callable[[], Any]) -> bytes:
    """A job as it travels.

    Raises:
        UsageError: it cannot: it is not made of a module's function and plain data.
    """
    function = getattr(job, "func", job)
    if getattr(function, "__module__", None) == "__main__":
        raise UsageError(
            f"workers: {function!r} is of the main module, which no worker imports: put it into a "
            "module of its own"
        )
    try:
        return pickle.dumps(job, pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise UsageError(f"workers: the work cannot travel to another process: {error}") from error


class Process:
    """A process that runs one job at a time and stays warm between them.

    On Linux the kernel ends it with the *thread* that started it.
    """

    def __init__(self, rule: EngineSpec, warm: bytes | None = None) -> None:
        """Starts it, and its first job ``warm``: what it needs in any case, free of limits. What
        that raises, later jobs raise again."""
        self.rule = rule
        self._cold = True
        self._here, there = Pipe()
        with there:
            # no `python -m`: it would look for modules in the folder that the user is in
            code = (
                f"import sys; sys.path[:] = {[os.path.abspath(p) for p in sys.path]!r}; "
                "from evertwin.engine.worker import main; "
                f"main({there.fileno()}, {rule.memory!r})"
            )
            self._child = subprocess.Popen(
                [sys.executable, "-P", "-c", code],
                stdin=subprocess.DEVNULL,
                stdout=2,
                pass_fds=[there.fileno()],
            )
        self._send(packed(dict) if warm is None else warm)

    @property
    def alive(self) -> bool:
        """Does it run?"""
        return self._child.poll() is None

    def run(self, job: bytes) -> Any:
        """What a job returns; raises what it raises.

        Raises:
            WorkLost: the process died, or the job took more than it may.
        """
        if self._cold:
            self._receive(START, "to start")
            self._cold = False
        self._send(job)
        done, result = self._receive(self.rule.time)
        if done:
            return result
        raise result

    def _send(self, job: bytes) -> None:
        try:
            self._here.send_bytes(job)
        except ConnectionError:
            raise self._lost() from None

    def _receive(self, seconds: float, what: str = "") -> tuple[bool, Any]:
        try:
            if not self._here.poll(seconds):
                self.kill()
                raise WorkLost(f"it took longer than {seconds:g} s {what}".rstrip())
            raw = self._here.recv_bytes()
        except (EOFError, ConnectionError):
            raise self._lost() from None
        found: tuple[bool, Any] = pickle.loads(raw)  # noqa: S301  (from our own child)
        return found

    def _lost(self) -> WorkLost:
        self.kill()
        code = self._child.returncode
        how = f"exit code {code}" if code >= 0 else signal.strsignal(-code) or f"signal {-code}"
        return WorkLost(f"its process died ({how}): out of memory, killed, or broken native code")

    def kill(self) -> None:
        """Ends it at once."""
        self._child.kill()
        self._child.wait()

    def end(self) -> None:
        """Ends it: cleanly if it waits for a job, within a second if it has one."""
        self._here.close()
        try:
            self._child.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.kill()


def run_alone(job: Callable[[], Any], seconds: float) -> Any:
    """The result of one job in a process of its own, which may take so long.

    Raises:
        UsageError: the job cannot travel.
        WorkLost: it took longer, or its process ended.
    """
    process = Process(EngineSpec(time=seconds))
    try:
        return process.run(packed(job))
    finally:
        process.end()
