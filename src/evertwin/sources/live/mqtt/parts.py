"""Messages → columns, and what a publisher's count says of losses.

>>> place('{"pose": {"x": 1.5}, "q": [4, 5]}', ["pose.x", "q.1", "q.9"])
{'pose.x': 1.5, 'q.1': 5, 'q.9': None}
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple, TypeGuard

from evertwin.sources.live.decode import Raw

LARGEST = 1 << 20
"""Bytes of the largest message that is read."""
WINDOW = 64
"""Messages that a broker may send twice: a count that goes back by less is no new publisher."""
GAPS = 256
"""Gaps that are remembered, to know what comes late."""


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


class Gap(NamedTuple):
    """Numbers that never came.

    >>> Gap(7, 8, 2, "a full queue").lost
    2
    """

    first: int
    last: int
    lost: int
    """So many of them were lost; others came, and their number could not be read."""
    cause: str


class Count:
    """A publisher's count: how many messages were lost before this one, and which are late.

    A number far from those before tells of a loss, or of a publisher that began anew; if the next
    one goes on from before, it was wrong, and told of nothing.

    >>> count = Count()
    >>> said = [(5, "a"), (6, "a"), (9, "a"), (9, "a"), (8, "a"), (0, "b"), (1, "b"), (999, "b")]
    >>> [count.missing(*one) for one in said], count.starts
    ([0, 0, 2, 0, -1, 0, 0, 997], 1)
    >>> count.missing(2, "b"), count.missing(4, "b"), count.late(3, "b")
    (-997, 1, True)
    """

    def __init__(self) -> None:
        self.newest: int | None = None
        self.publisher: Raw = None
        self.starts = 0
        """How often the publisher began anew."""
        self.cause = ""
        """Of what was lost, or is found now."""
        self._left: tuple[int, Gap | None] | None = None
        """The newest number before the last one, where that is far from it; what lies between."""
        self._unread = 0
        """Messages that came since the newest number and whose own is not known."""
        self._apart: int | None = None
        """The last number that was taken for a wrong one: right, once the count comes to it."""
        self._gaps: deque[Gap] = deque(maxlen=GAPS)

    def late(self, number: Raw, publisher: Raw) -> bool:
        """Is it one of those before the newest that had not come?"""
        if not _countable(number) or self.newest is None or publisher != self.publisher:
            return False
        old = publisher is not None and number < self.newest - WINDOW  # who begins anew says so
        return old or self._gap(int(number)) is not None

    def missing(
        self, number: Raw, publisher: Raw, cause: str = "", *, refused: bool = False
    ) -> int:
        """Messages that were lost between this one and the newest before it, for a cause; negative:
        so many of those were not. One that is ``refused`` tells nothing by a number far off."""
        if not _countable(number):
            self._unread += 1
            return 0
        number, newest = int(number), self.newest
        if newest is None or publisher != self.publisher:
            return self._begin(number, publisher)
        if self._left is not None and not 0 <= number - newest <= WINDOW:
            if abs(number - self._left[0]) > WINDOW:  # another that is far
                self._unread += 1
                return 0
            wrong = self._take_back()
            missing = self.missing(number, publisher, cause) - (wrong.lost if wrong else 0)
            if wrong is not None and missing < 0:
                self.cause = wrong.cause
            return missing
        self._left = None
        gap = self._gap(number)
        if gap is not None:
            return self._fill(gap, number)
        if publisher is not None and number < newest - WINDOW:
            return 0
        if abs(number - newest) <= WINDOW:
            return self._go_on(number, cause) if number > newest else 0  # sent twice
        if refused:
            self._unread += 1
            return 0
        if number < newest:
            self._begin(number, publisher)
            self._left = newest, None
            return 0
        lost = self._go_on(number, cause)
        self._left = newest, self._gaps[-1]
        return lost

    def _gap(self, number: int) -> Gap | None:
        return next((one for one in self._gaps if one.first <= number <= one.last), None)

    def _begin(self, number: int, publisher: Raw) -> int:
        self.starts += self.newest is not None
        self.newest, self.publisher = number, publisher
        self._unread, self._left, self._apart = 0, None, None
        self._gaps.clear()
        return 0

    def _go_on(self, number: int, cause: str) -> int:
        assert self.newest is not None
        lost = number - self.newest - 1
        if self._apart is not None and self.newest < self._apart < number:
            lost, self._apart = lost - 1, None
        lost = max(lost - self._unread, 0)
        if number > self.newest + 1:
            self._gaps.append(Gap(self.newest + 1, number - 1, lost, cause))
        self.newest, self._unread, self.cause = number, 0, cause
        return lost

    def _take_back(self) -> Gap | None:
        """The number before this one was none of the publisher's; what was called lost for it."""
        assert self._left is not None
        self._apart = self.newest
        (self.newest, gap), self._left, self._unread = self._left, None, self._unread + 1
        if gap is not None:
            self._gaps.remove(gap)
        return gap

    def _fill(self, gap: Gap, number: int) -> int:
        self._gaps.remove(gap)
        left = max(gap.lost - 1, 0)
        for first, last in ((gap.first, number - 1), (number + 1, gap.last)):
            if first <= last:
                count = min(left, last - first + 1)
                left -= count
                self._gaps.append(Gap(first, last, count, gap.cause))
        self.cause = gap.cause
        return -1 if gap.lost else 0


def _countable(number: Raw) -> TypeGuard[int | float]:
    return isinstance(number, int | float) and number == number and abs(number) <= 2**62
