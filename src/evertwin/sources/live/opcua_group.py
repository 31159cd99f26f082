"""Values that come one by one → samples: those of one source time stamp belong together.

A server reports changes. A column that is not reported with a stamp did not change, so it has the
value that it had; where a sample is complete, or later ones came and its turn is over, it goes out.

>>> groups = Groups(("x", "y"), together=1000)
>>> groups.put("x", 1.0, 5_000_000, 0.0); groups.put("y", 2.0, 5_000_400, 0.0)
>>> groups.put("x", 3.0, 9_000_000, 0.1)
>>> groups.take(0.1, settle=0.2), groups.take(0.4, settle=0.2)
([(5000000, {'x': 1.0, 'y': 2.0})], [(9000000, {'x': 3.0, 'y': 2.0})])
"""

from __future__ import annotations

from evertwin.sources.live.decode import Raw

MOST = 4096
"""Samples that are put together at once."""


class Groups:
    """What is being put together. See the module for an example."""

    def __init__(self, names: tuple[str, ...], together: int) -> None:
        self.names = names
        self.together = together
        """Nanoseconds."""
        self._known: dict[str, Raw] = {}
        self._open: dict[int, tuple[float, dict[str, Raw]]] = {}
        """Stamp → when its first value came, and its values."""

    def put(self, name: str, value: Raw, stamp: int, now: float) -> None:
        """A value with its source time stamp [ns]."""
        near = (s for s in reversed(self._open) if abs(s - stamp) <= self.together)
        _, values = self._open.setdefault(next(near, stamp), (now, {}))
        values[name] = value

    def take(self, now: float, settle: float) -> list[tuple[int, dict[str, Raw]]]:
        """The samples that are ready, in order of their stamps.

        Args:
            now: monotonic [s].
            settle: how long one waits for what it lacks [s].
        """
        out: list[tuple[int, dict[str, Raw]]] = []
        for stamp in sorted(self._open):
            came, values = self._open[stamp]
            if len(values) < len(self.names) and now < came + settle and len(self._open) < MOST:
                break
            del self._open[stamp]
            self._known |= values
            out.append((stamp, {**self._known, **values}))
        return out
