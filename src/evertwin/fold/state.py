"""States: copied, compared, saved and loaded. Without pickle, ever.

A state is a (nested) named tuple of arrays and plain scalars. Its schema is its template: loading
refuses a file whose fields, types or ranks differ.

>>> import numpy as np
>>> from typing import NamedTuple
>>> class S(NamedTuple):
...     x: np.ndarray
...     n: int
>>> s = S(np.zeros(2), 3)
>>> equal(load(save(s), like=s), s)
True
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, cast

import numpy as np

from evertwin.errors import StoreError

S = TypeVar("S")


def copy(state: S) -> S:
    """An independent copy: ``step`` may then consume the original."""
    if isinstance(state, np.ndarray):
        return cast(S, state.copy())
    if isinstance(state, tuple):
        parts = [copy(item) for item in state]
        return cast(S, type(state)(*parts) if hasattr(state, "_fields") else tuple(parts))
    return state


def _walk(state: object, path: str = "s") -> Iterator[tuple[str, object]]:
    if isinstance(state, tuple):
        names = getattr(state, "_fields", range(len(state)))
        for name, item in zip(names, state, strict=True):
            yield from _walk(item, f"{path}.{name}")
    else:
        yield path, state


def equal(a: object, b: object) -> bool:
    """Bit for bit equality of two states; NaN equals NaN."""
    left, right = dict(_walk(a)), dict(_walk(b))
    if left.keys() != right.keys():
        return False
    return all(_same(left[key], right[key]) for key in left)


def _same(a: object, b: object) -> bool:
    x, y = np.asarray(a), np.asarray(b)
    return x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes()


def leaves(state: object) -> dict[str, np.ndarray]:
    """Every array and scalar of a state by its path.

    >>> list(leaves((1.0, (np.zeros(2), 3))))
    ['s.0', 's.1.0', 's.1.1']

    Raises:
        StoreError: a leaf is neither an array nor a plain number, text or None.
    """
    arrays: dict[str, np.ndarray] = {}
    for path, value in _walk(state):
        array = np.asarray(value if value is not None else np.zeros(0, dtype=np.bool_))
        if array.dtype.hasobject:
            raise StoreError(f"{path}: expected an array or a number, got {type(value).__name__}")
        arrays[path] = array
    return arrays


def save(state: object) -> bytes:
    """The state as an uncompressed ``npz`` file.

    Raises:
        StoreError: a leaf is neither an array nor a plain number, text or None.
    """
    buffer = io.BytesIO()
    np.savez(buffer, **leaves(state))  # type: ignore[arg-type]  # names are no options of savez
    return buffer.getvalue()


def load(content: bytes, like: S) -> S:
    """The state saved in ``content``, checked against the template ``like``.

    Raises:
        StoreError: a field is missing or has another type or rank.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return filled(like, arrays)


def filled(like: S, arrays: Mapping[str, Any]) -> S:
    """A state in the shape of ``like`` from its `leaves`.

    Raises:
        StoreError: a field is missing or has another type or rank.
    """
    return cast(S, _fill(like, arrays, "s"))


def _fill(like: object, arrays: Mapping[str, Any], path: str) -> object:
    if isinstance(like, tuple):
        names = getattr(like, "_fields", range(len(like)))
        parts: list[Any]
        parts = [_fill(v, arrays, f"{path}.{n}") for n, v in zip(names, like, strict=True)]
        return type(like)(*parts) if hasattr(like, "_fields") else tuple(parts)
    if path not in arrays:
        raise StoreError(f"checkpoint: field {path} is missing: it was saved by another version")
    array = arrays[path]
    if isinstance(like, np.ndarray):
        if array.dtype != like.dtype or array.ndim != like.ndim:
            raise StoreError(
                f"checkpoint: {path} expected {like.dtype} of rank {like.ndim}, "
                f"got {array.dtype} of rank {array.ndim}: it was saved by another version"
            )
        return array
    return None if like is None else array.item()
