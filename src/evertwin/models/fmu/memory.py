"""Shared memory between two processes: arrays copied in and out at known places.

The side that starts decides where everything lies, and reads back only there: what the other side
says about places or sizes is never used.

>>> shared = Shared(1 << 16)
>>> a = np.arange(3.0)
>>> inside, two, yes = placed(shared.view, shared.put([(a, 2, True)])[0])
>>> inside += 1.0
>>> shared.fetch()
>>> a.tolist()
[1.0, 2.0, 3.0]
>>> shared.close()
"""

from __future__ import annotations

import importlib
import math
import mmap
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

TEXT, TEXT_SIZE = 0, 4096
"""Where the last words of the child lie [bytes]."""
DATA = TEXT + TEXT_SIZE
_ALIGNED = 64


class Shared:
    """Anonymous memory that a child process maps by its file number. See the module."""

    def __init__(self, size: int) -> None:
        self.file = os.memfd_create("evertwin")
        os.ftruncate(self.file, size)
        self.view = mmap.mmap(self.file, size)
        self.base = DATA
        """Where arguments begin."""
        self.end = DATA
        self._placed: list[tuple[np.ndarray, int]] = []
        self._old: list[mmap.mmap] = []

    def reserve(self, array: np.ndarray) -> int:
        """Room that stays, in front of all arguments, filled with ``array``; its place."""
        at = self.base
        self.base = at + -(-array.nbytes // _ALIGNED) * _ALIGNED
        self.view[at : at + array.nbytes] = array.tobytes()
        return at

    def array(self, at: int, dtype: Any, count: int) -> np.ndarray:
        """A view of the memory."""
        return np.frombuffer(self.view, dtype, count, at)

    def need(self, values: Any) -> int:
        """Bytes that arguments take."""
        if isinstance(values, np.ndarray):
            return int(values.nbytes) + _ALIGNED
        if isinstance(values, list | tuple):
            return sum(self.need(value) for value in values)
        return 0

    def put(self, values: Sequence[Any]) -> list[Any]:
        """Copies arrays in; the description of all values that `placed` reads."""
        self.end, self._placed = self.base, []
        return [self._put(value) for value in values]

    def _put(self, value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return self._put_array(value)
        if isinstance(value, list | tuple):
            items, kind = [self._put(item) for item in value], type(value)
            named = hasattr(value, "_fields")
            return {"n": [kind.__module__, kind.__name__, items]} if named else items
        return value.item() if isinstance(value, np.generic) else value

    def _put_array(self, value: np.ndarray) -> dict[str, Any]:
        for array, at in self._placed:
            if array is value:
                return {"a": [at, value.dtype.str, list(value.shape)]}
        at = self.end
        self.end = at + -(-max(value.nbytes, 1) // _ALIGNED) * _ALIGNED
        self.view[at : at + value.nbytes] = value.tobytes()
        self._placed.append((value, at))
        return {"a": [at, value.dtype.str, list(value.shape)]}

    def fetch(self) -> None:
        """Copies the arrays back that may be written."""
        for array, at in self._placed:
            if array.flags.writeable and array.size:
                inside = np.frombuffer(self.view, array.dtype, array.size, at)
                array[...] = inside.reshape(array.shape)

    def grow(self, size: int) -> None:
        """More room; views taken before stay valid. The child has to map it anew."""
        os.ftruncate(self.file, size)
        self._old.append(self.view)
        self.view = mmap.mmap(self.file, size)

    def close(self) -> None:
        """Lets go of the file; the memory goes with the last view."""
        if self.file >= 0:
            os.close(self.file)
            self.file = -1


def placed(view: Any, where: Any) -> Any:
    """What `Shared.put` described."""
    if isinstance(where, list):
        return tuple(placed(view, item) for item in where)
    if not isinstance(where, dict):
        return where
    if "n" in where:
        module, name, items = where["n"]
        return getattr(importlib.import_module(module), name)(*placed(view, items))
    at, dtype, shape = where["a"]
    return np.frombuffer(view, np.dtype(dtype), math.prod(shape), at).reshape(shape)
