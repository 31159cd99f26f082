"""Messages → columns, and what a publisher's count says of losses.

>>> place('{"pose": {"x": 1.5}, "q": [4, 5]}', ["pose.x", "q.1", "q.9"])
{'pose.x': 1.5, 'q.1': 5, 'q.9': None}
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from evertwin.sources.live.decode import Raw

LARGEST = 1 << 20
"""Bytes of the largest message that is read."""
WINDOW = 64
"""Messages that a broker may send twice: a count that goes back by less is no new publisher."""


class NoMessage(Exception):
    """A payload that is not what was expected.

    >>> str(NoMessage("not JSON"))
    'not JSON'
    """


def place(payload: bytes | str, paths: Iterable[str]) -> dict[str, Raw]:
    """What stands at each path; the whole payload at the empty one.

    Raises:
        NoMessage: it is too large, no JSON, or no text.
    """
    if len(payload) > LARGEST:
        raise NoMessage("a message that is too large")
    try:
        text = payload if isinstance(payload, str) else payload.decode()
        paths = list(paths)
        tree = json.loads(text) if any(paths) else None
    except (ValueError, RecursionError):
        raise NoMessage("a message that is not JSON") from None
    return {path: _at(tree, path) if path else text.strip() for path in paths}


def _at(tree: Any, path: str) -> Raw:
    for key in path.split("."):
        if isinstance(tree, dict) and key in tree:
            tree = tree[key]
        elif isinstance(tree, list) and key.isdecimal() and int(key) < len(tree):
            tree = tree[int(key)]
        else:
            return None
    return tree if isinstance(tree, float | int | bool | str | list) else None


class Count:
    """A publisher's count: how many messages are missing before this one.

    >>> count = Count()
    >>> said = [(5, "a"), (6, "a"), (9, "a"), (9, "a"), (8, "a"), (0, "b"), (1, "b")]
    >>> [count.missing(*one) for one in said], count.starts
    ([0, 0, 2, 0, 0, 0, 0], 1)
    """

    def __init__(self) -> None:
        self.newest: int | None = None
        self.publisher: Raw = None
        self.starts = 0
        """How often the publisher began anew."""

    def missing(self, number: Raw, publisher: Raw) -> int:
        """Messages between this one and the newest before it."""
        if not isinstance(number, int | float) or number != number or abs(number) > 2**62:
            return 0
        number, newest = int(number), self.newest
        if newest is not None and publisher == self.publisher:
            if newest - WINDOW < number <= newest:
                return 0  # sent twice
            if number > newest:
                self.newest = number
                return number - newest - 1
        self.starts += newest is not None
        self.newest, self.publisher = number, publisher
        return 0
