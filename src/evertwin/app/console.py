"""What a command prints: data on stdout, progress on stderr."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from typing import Any

import typer

from evertwin.fold import plain

__all__ = ["Progress", "show"]


def show(content: Mapping[str, Any], text: str, as_json: bool) -> None:
    """The result, as one JSON document or as text."""
    typer.echo(json.dumps(plain(content), indent=2, allow_nan=False) if as_json else text)


class Progress:
    """Rows and time on stderr, only on a terminal.

    >>> Progress().shown
    0
    """

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._live = sys.stderr.isatty()
        self.shown = 0

    def __call__(self, rows: int, seconds: float) -> None:
        """``rows`` so far, ``seconds`` of data."""
        self.shown += 1
        if self._live:
            rate = rows / max(time.perf_counter() - self._began, 1e-9)
            line = f"\r{rows:,} rows, {seconds:,.0f} s of data, {rate:,.0f} rows/s"
            typer.echo(line, err=True, nl=False)

    def close(self) -> None:
        """Ends the line."""
        if self._live and self.shown:
            typer.echo("", err=True)
