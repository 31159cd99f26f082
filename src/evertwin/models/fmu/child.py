"""The child process: holds one FMU, and runs loops over it for the twin's process.

``python -m evertwin.models.fmu.child ORDERS REPLIES MEMORY``: three open files. An order is one
line of JSON; a reply is three numbers of fixed size, so that nothing an FMU writes into this
process is ever interpreted by the other one. Arrays lie in the shared memory. Whatever goes wrong
ends the process; the last words are left in the shared memory as text.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import math
import mmap
import os
import resource
import signal
import struct
import sys
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np

from evertwin.models.fmu import kernels
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.memory import TEXT, TEXT_SIZE, placed

REPLY = struct.Struct("<qqd")
"""Always 1, a whole number, a number."""
_PDEATHSIG = 1


class Child:
    """What the process holds.

    >>> Child.__name__
    'Child'
    """

    def __init__(self, memory: int, limit: int) -> None:
        self.memory, self.limit = memory, limit
        self.shared = mmap.mmap(memory, os.fstat(memory).st_size)
        self.instance: Any = None
        self.page = np.zeros(0, dtype=np.int64)

    def order(self, order: Mapping[str, Any]) -> tuple[int, float]:
        """Does one thing: the result as a whole number and as a number."""
        done = getattr(self, f"do_{order['do']}")(order)
        if isinstance(done, float):
            return 0, done
        return int(done or 0), 0.0

    def do_load(self, order: Mapping[str, Any]) -> int:
        """Loads and initialises the FMU; the size of its saved state."""
        module = importlib.import_module("evertwin.models.fmu.instance")
        limit_memory(self.limit)
        self.instance = module.Instance(order["plan"])
        self.instance.begin(order["parameters"], None, 0.0)
        return int(self.instance.saved_size()) if order["plan"]["saves"] else 0

    def do_page(self, order: Mapping[str, Any]) -> int:
        """Takes the page into use; does the FMU start where it is told to?"""
        self.page = np.frombuffer(self.shared, np.int64, order["words"], order["offset"])
        self.instance.attach(self.page)
        return 1

    def do_takes(self, order: Mapping[str, Any]) -> int:
        """Does the FMU take start values?"""
        p, x = placed(self.shared, order["p"]), placed(self.shared, order["x"])
        return int(self.instance.takes_states(p, x))

    def do_map(self, order: Mapping[str, Any]) -> int:
        """The shared memory has grown."""
        size = os.fstat(self.memory).st_size
        limit_memory(self.limit + size)
        # the old mapping stays: the page lies in it, and both show the same memory
        self.shared = mmap.mmap(self.memory, size)
        return 1

    def do_initial(self, order: Mapping[str, Any]) -> int:
        """The first state, into shared memory."""
        self.page[at.INSIDE] = 1
        self.instance.initial(placed(self.shared, order["p"]), placed(self.shared, order["x"]))
        self.page[at.INSIDE] = 0
        return 1

    def do_loop(self, order: Mapping[str, Any]) -> Any:
        """Runs a compiled loop over the FMU and its wrappers."""
        step, observe, context = kernels.step.address, kernels.adopt.address, self.page
        plans = []
        for name, terms, where in order["layers"]:
            plan = placed(self.shared, where)
            plan[1:4] = step, observe, context.ctypes.data
            plans.append(plan)
            module = importlib.import_module(name)
            if terms:
                module.resolve(plan, terms)
            step, observe, context = module.step.address, module.adopt.address, plan
        loop = getattr(importlib.import_module(order["module"]), order["name"])
        arguments = [placed(self.shared, where) for where in order["arguments"]]
        limit_time(order["seconds"])
        return loop(step, observe, context, *arguments)


def limit_memory(extra: int) -> None:
    """Address space: what is in use now and ``extra`` bytes."""
    with open("/proc/self/statm", encoding="ascii") as statm:
        used = int(statm.read().split()[0]) * mmap.PAGESIZE
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = used + extra
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_AS, (wanted, hard))


def limit_time(seconds: float) -> None:
    """Processor time: what was used until now and ``seconds``."""
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + seconds) + 1, hard))


def settle_in() -> None:
    """Limits that hold for the whole life, and an end together with the parent."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))
    ctypes.CDLL(None).prctl(_PDEATHSIG, signal.SIGKILL)


def main(arguments: list[str]) -> None:
    """Serves orders until their file ends."""
    orders, replies, memory, limit = (int(word) for word in arguments)
    settle_in()
    child = Child(memory, limit)

    def last_words(
        kind: type[BaseException], error: BaseException, _: TracebackType | None
    ) -> None:
        text = f"{kind.__name__}: {error}".encode()[: TEXT_SIZE - 8]
        child.shared[TEXT : TEXT + 8] = struct.pack("<q", len(text))
        child.shared[TEXT + 8 : TEXT + 8 + len(text)] = text
        os._exit(at.EXIT_LIBRARY)

    sys.excepthook = last_words
    with os.fdopen(orders, "rb") as lines:
        for line in lines:
            whole, number = child.order(json.loads(line))
            os.write(replies, REPLY.pack(1, whole, number))


if __name__ == "__main__":
    main(sys.argv[1:])
