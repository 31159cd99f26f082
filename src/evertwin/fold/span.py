"""A length of the stream: so many rows, or so much time.

What is said in time means the same at any rate of the rows; what is said in rows is exact.

>>> Span(600).at(None), Span(seconds=30.0).at(10.0), str(Span(seconds=30.0))
(600, 300, '30 s')
"""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.errors import UsageError

MOST = 1_000_000
"""Rows of the longest span: with forty columns they take 320 MB."""


@dataclass(frozen=True)
class Span:
    """Either rows or seconds.

    >>> Span(seconds=0.25).at(10.0), Span(seconds=30.0).at(1.0003), Span(seconds=0.1).at(1.0)
    (2, 30, 1)
    """

    rows: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        if (self.rows is None) == (self.seconds is None):
            raise UsageError("expected a span of rows or of seconds, got both or neither")

    def at(self, rate: float | None) -> int:
        """Its rows at ``rate`` [Hz], rounded; one at least, unless it is none.

        Raises:
            UsageError: it is a time, and there is no rate, or far too many rows are in it.
        """
        if self.rows is not None:
            return self.rows
        if rate is None:
            raise UsageError(
                f"{self}: a time needs the rate of the rows: set rate in [clock], or say it in rows"
            )
        rows = (self.seconds or 0.0) * rate
        if not rows <= MOST:
            raise UsageError(f"{self}: {rows:.3g} rows at {rate:g} Hz: expected at most {MOST}")
        return max(round(rows), int(bool(self.seconds)))

    def __str__(self) -> str:
        return f"{self.seconds:g} s" if self.rows is None else f"{self.rows} rows"
