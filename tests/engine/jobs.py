"""Work for the tests of engines, in a module that a worker can import."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from evertwin.errors import ModelError
from evertwin.fold.records import Request
from evertwin.types import Json


class Odd(Exception):
    """Cannot be unpickled: its arguments are not those of its making."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{what} at {where}")


def work(request: Request) -> Mapping[str, Json]:
    """What a request's kind asks for."""
    if request.kind == "fails":
        raise ModelError("arm: no convergence")
    if request.kind == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if request.kind == "leaves":
        sys.exit(3)
    if request.kind == "bug":
        raise ZeroDivisionError("a bug")
    if request.kind == "odd":
        raise Odd("a bug", "home")
    if request.kind == "slow":
        time.sleep(0.5)
    if request.kind == "endless":
        time.sleep(600)
    if request.kind == "native":
        hold(600)
    if request.kind == "large":
        return {"bytes": len(bytearray(2_000_000_000))}
    return {"rows": request.window[1] - request.window[0], "process": os.getpid()}


def hold(seconds: int) -> None:
    """Native code that keeps the interpreter to itself."""
    ctypes.PyDLL(None).sleep(seconds)


def told(path: Path, seconds: float = 600.0, *, native: bool = False) -> int:
    """Writes the number of its process down, then takes long."""
    written = path.with_suffix(".part")  # whoever sees the file may end this: it is there whole
    written.write_text(str(os.getpid()))
    written.rename(path)
    if native:
        hold(int(seconds))
    time.sleep(seconds)
    return os.getpid()


def noisy(text: str) -> str:
    """Prints, and reads, as careless code does."""
    sys.stdout.write(text)
    sys.stdout.flush()
    return sys.stdin.read() + text


def first() -> None:
    """Leaves a trace of its call."""
    os.environ["WARM"] = "yes"


def is_warm(_: int) -> str:
    return os.environ.get("WARM", "no")


def main_file(_: int) -> str | None:
    """Where the main module of this process comes from."""
    return getattr(sys.modules["__main__"], "__file__", None)
