"""The inside of a worker: a process that runs one job after the other until its parent ends.

It is started by `evertwin.engine.process` with one end of a socket, and knows nothing of the user's
main module. Three things end it with its parent, however that ends: the socket's end while it waits
for a job; a thread that watches for it during one; on Linux a signal of the kernel, where native
code holds the interpreter.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import select
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

from evertwin.errors import WorkLost

PR_SET_PDEATHSIG = 1
LAST = 0.5
"""Time that a process without a job has to end by itself [s]."""
STATM = Path("/proc/self/statm")


def main(number: int, memory: float) -> None:
    """Serves jobs that come through the socket with this file number; ``memory`` [GB] is the most
    that they may take over what the process has after the first one."""
    os.set_inheritable(number, False)
    # Ctrl-C reaches every process of a terminal: what is stopped by it is the parent's to say
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_end_with_parent, args=(number,), daemon=True).start()
    # the socket's end is the end
    with suppress(EOFError, ConnectionError), Connection(number) as parent:
        parent.send_bytes(_outcome(parent.recv_bytes(), memory))
        _limit(memory)
        while True:
            parent.send_bytes(_outcome(parent.recv_bytes(), memory))


def _end_with_parent(number: int) -> None:
    """Ends the process where the other end of the socket is gone, whatever the main thread does."""
    watch = select.poll()
    watch.register(number, 0)  # hang-up alone
    watch.poll()
    time.sleep(LAST)
    os._exit(1)


def _limit(memory: float) -> None:
    """From here on the process may take ``memory`` [GB] more than it has."""
    if not STATM.exists():
        return  # the other systems do not enforce a limit of the address space
    size = int(STATM.read_text().split()[0]) * resource.getpagesize() + int(memory * 1e9)
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    least = size if most == resource.RLIM_INFINITY else min(size, most)
    resource.setrlimit(resource.RLIMIT_AS, (least, most))


def _outcome(task: bytes, memory: float) -> bytes:
    """(True, what the job returns) or (False, what it raises), as it travels."""
    try:
        job = pickle.loads(task)  # noqa: S301  (from our own parent, through our own socket)
        return pickle.dumps((True, job()), pickle.HIGHEST_PROTOCOL)
    except MemoryError:
        return pickle.dumps((False, WorkLost(f"it took more than its {memory:g} GB of memory")))
    except Exception as error:  # noqa: BLE001  (the edge: what a job raises is raised in the parent)
        return _raised(error)


def _raised(error: Exception) -> bytes:
    """An exception with the place where it was raised; one that cannot travel goes as text."""
    where = "".join(traceback.format_exception(error))
    error.add_note(f"in a process of its own:\n{where}")
    try:
        raw = pickle.dumps((False, error))
        pickle.loads(raw)  # noqa: S301  (our own bytes: can the parent read them?)
    except (AttributeError, TypeError, ValueError, pickle.PickleError):
        return pickle.dumps((False, RuntimeError(where)))
    return raw
