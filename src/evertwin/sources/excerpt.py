"""A part of a recording: ``FILE@START:STOP``, in seconds from its first stamp.

Either end may be left out. A file whose own name holds an ``@`` is a file first.

>>> Excerpt.parse("run.csv@10:20.5")
Excerpt(path=PosixPath('run.csv'), start=10.0, stop=20.5)
>>> Excerpt.parse("run.csv@:60").start, Excerpt.parse("run.csv").whole
(-inf, True)
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from evertwin.errors import UsageError
from evertwin.fold import Chunk


@dataclass(frozen=True)
class Excerpt:
    """Which file, from when to when.

    >>> Excerpt(Path("run.csv"), 10.0).whole
    False
    """

    path: Path
    start: float = -math.inf
    """Seconds from the recording's first stamp; rows at it are in."""
    stop: float = math.inf
    """Rows at it are out, so that parts that meet share no row."""

    @classmethod
    def parse(cls, text: str | Path) -> Excerpt:
        """The part that is meant.

        Raises:
            UsageError: what follows the ``@`` is not START:STOP.
        """
        path, at, span = str(text).rpartition("@")
        if not at or ":" not in span or Path(text).exists():
            return cls(Path(text))
        try:
            start, stop = (float(word) if word else None for word in span.split(":"))
        except ValueError as error:
            raise UsageError(
                f"{text}: expected FILE@START:STOP in seconds from the recording's first stamp, "
                f"such as run.csv@10:20 or run.csv@:60, got {span!r}"
            ) from error
        part = cls(
            Path(path), -math.inf if start is None else start, math.inf if stop is None else stop
        )
        if not part.start < part.stop:
            raise UsageError(f"{text}: expected START < STOP, got {span!r}")
        return part

    @property
    def whole(self) -> bool:
        """Is it the whole recording?"""
        return math.isinf(self.start) and math.isinf(self.stop)

    def of(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """The part's samples; seconds count from the first stamp of all sources together."""
        origin: int | None = None
        for chunk in chunks:
            origin = int(chunk.t[0]) if origin is None else origin
            seconds = (chunk.t - origin) * 1e-9
            inside = (seconds >= self.start) & (seconds < self.stop)
            if inside.all():
                yield chunk
            elif inside.any():
                yield chunk._replace(t=chunk.t[inside], v=chunk.v[inside])
