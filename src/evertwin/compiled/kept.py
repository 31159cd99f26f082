"""What is kept of a function from one process to the next: machine code, or how long it ran plain.

Both stand where Numba keeps machine code, and hold for one stamp of the function.

>>> is_kept(is_kept, "0123"), plain_seconds(is_kept, "0123")
(False, 0.0)
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

OF_BEFORE = (ImportError, AttributeError, EOFError, pickle.UnpicklingError)
"""What reading raises where types of another version are named, or a file is cut off."""


def is_kept(function: Callable[..., Any], stamp: str) -> bool:
    """Does Numba's cache hold machine code of a function with this stamp?"""
    found = _folder(function).glob(f"{_name(function)}.py*.nbi")
    return any(stamp.encode() in path.read_bytes() for path in found)


@functools.cache
def index_of_code() -> type[Any]:
    """Numba's index of machine code; what cannot be read is not there, and is compiled anew."""
    from numba.core.caching import IndexDataCacheFile

    class Index(IndexDataCacheFile):  # type: ignore[misc]
        def _load_index(self) -> dict[Any, str]:
            with contextlib.suppress(*OF_BEFORE):
                return dict(super()._load_index())
            return {}

        def _load_data(self, name: str) -> Any:
            try:
                return super()._load_data(name)
            except OF_BEFORE as error:
                raise FileNotFoundError(name) from error  # as where the file is gone

    return Index


def plain_seconds(function: Callable[..., Any], stamp: str) -> float:
    """Seconds that a function with this stamp has run plain in processes that ended."""
    with contextlib.suppress(OSError, ValueError):  # none yet, or half written: begin anew
        told, seconds = _note(function).read_text("ascii").split()
        return float(seconds) if told == stamp else 0.0
    return 0.0


def write_plain_seconds(function: Callable[..., Any], stamp: str, seconds: float) -> None:
    """Keeps them for the next process; where nothing may be written, each process begins anew."""
    with contextlib.suppress(OSError):
        _folder(function).mkdir(parents=True, exist_ok=True)
        _note(function).write_text(f"{stamp} {seconds:.3f}", "ascii")


def _note(function: Callable[..., Any]) -> Path:
    return _folder(function) / f"{_name(function)}.plain"


def _name(function: Callable[..., Any]) -> str:
    code = function.__code__
    return f"{Path(code.co_filename).stem}.{function.__qualname__}-{code.co_firstlineno}"


def _folder(function: Callable[..., Any]) -> Path:
    """Where Numba keeps code: the folder it was told, beside the source, else the user's."""
    beside = Path(function.__code__.co_filename).absolute().parent
    own = beside / "__pycache__"
    given = os.environ.get("NUMBA_CACHE_DIR")
    if not given and os.access(own if own.exists() else beside, os.W_OK):
        return own
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"
    named = f"{beside.name}_{hashlib.sha1(str(beside).encode()).hexdigest()}"
    return Path(given or user) / named
