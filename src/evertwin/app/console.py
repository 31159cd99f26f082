"""What a command prints: data on stdout, progress on stderr."""

from __future__ import annotations

import json
import math
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Mapping
from typing import Any

import typer

from evertwin.fold import plain


def show(content: Mapping[str, Any], text: str, as_json: bool) -> None:
    """The result, as one JSON document or as text, which a terminal gets by its width."""
    if as_json:
        text = json.dumps(plain(content), indent=2, allow_nan=False)
    elif sys.stdout.isatty():
        text = fitted(text, shutil.get_terminal_size().columns)
    typer.echo(text)


def fitted(text: str, width: int) -> str:
    """Lines that are too long go on below, between words.

    >>> print(fitted("  rms 5 -> 4 mm over all of it", 20))
      rms 5 -> 4 mm over
        all of it
    """
    return "\n".join(
        "\n".join(textwrap.wrap(
            line, width, subsequent_indent=" " * (len(line) - len(line.lstrip()) + 2),
            break_long_words=False, break_on_hyphens=False, replace_whitespace=False,
        )) if len(line) > width else line
        for line in text.split("\n")
    )  # fmt: skip


class Alive:
    """What goes on, on stderr: each step when it begins, then a line every two seconds.

    >>> with Alive() as alive:
    ...     alive.say("compiling")
    """

    EVERY = 2.0
    """Longest silence [s]."""

    def __init__(self) -> None:
        self._step, self._began = "", time.monotonic()
        self._ended, self._said = threading.Event(), threading.Event()
        self._beats = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> Alive:
        self._beats.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._said.set()
        self._beats.join()

    def say(self, step: str) -> None:
        """What begins now."""
        self._step, self._began = step, time.monotonic()
        typer.echo(step, err=True)
        self._said.set()

    def _beat(self) -> None:
        while not self._ended.is_set():
            if not self._said.wait(self.EVERY) and self._step:
                took = time.monotonic() - self._began
                typer.echo(f"{self._step} … {took:.0f} s", err=True)
            self._said.clear()


class Progress:
    """Rows and time on stderr, only on a terminal; where none come for `SILENT`, for how long.

    >>> Progress().shown
    0
    """

    SILENT = 2.0
    """Seconds without a row from which it is said that work on a candidate goes on."""

    def __init__(self, line: str = "the first rows") -> None:
        self._began = self._heard = time.perf_counter()
        self._live = sys.stderr.isatty()
        self._line = line
        self._width = 0
        self._ended = threading.Event()
        self.shown = 0
        if self._live:
            threading.Thread(target=self._tick, daemon=True).start()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __call__(self, rows: int, seconds: float) -> None:
        """``rows`` so far, ``seconds`` of data."""
        self._heard = time.perf_counter()
        self.shown += 1
        rate = rows / max(self._heard - self._began, 1e-9)
        self._line = f"{rows:,} rows, {seconds:,.0f} s of data"
        if self._live:
            self._show(f"{self._line}, {rate:,.0f} rows/s")

    def close(self) -> None:
        """Ends the line."""
        self._ended.set()
        if self._width:
            typer.echo("", err=True)

    def _tick(self) -> None:
        """Slow work (a fit, a search for a correction) brings no row for a while."""
        while not self._ended.wait(1.0):
            silent = time.perf_counter() - self._heard
            if silent > self.SILENT:
                self._show(f"{self._line}; at work on what they tell for {silent:.0f} s")

    def _show(self, line: str) -> None:
        typer.echo(f"\r{line:<{self._width}}", err=True, nl=False)
        self._width = len(line)


class Search:
    """A search for parameters on stderr: a bar, evaluations, the cost; only on a terminal.

    >>> watch = Search()
    >>> watch(3, 1.5), watch.best
    (True, 1.5)
    """

    WIDTH = 20
    """Letters of the bar. It fills by orders of magnitude that the cost falls: the end is not
    known before."""

    def __init__(self) -> None:
        self._live = sys.stderr.isatty()
        self._first = 0.0
        self._told = 0.0
        self.best = math.inf
        self.shown = 0

    def __call__(self, evaluations: int, cost: float) -> bool:
        """``evaluations`` so far, the present ``cost``; goes on."""
        if evaluations <= 2 or not self._first:
            self._first, self.best = max(cost, 1e-300), math.inf  # another search begins
        self.best = min(self.best, cost)
        now = time.perf_counter()
        if self._live and (now - self._told > 0.1 or not self.shown):
            self._told = now
            self.shown += 1
            typer.echo(f"\r{self.line(evaluations, cost)}", err=True, nl=False)
        return True

    def line(self, evaluations: int, cost: float) -> str:
        """What is shown."""
        fallen = math.log10(max(self._first, 1e-300) / max(self.best, 1e-300))
        full = min(self.WIDTH, max(0, round(4 * fallen)))
        bar = "#" * full + "-" * (self.WIDTH - full)
        return (
            f"[{bar}] {evaluations:5d} evaluations, cost {cost:.4g}, best {self.best:.4g} "
            "(Ctrl-C keeps it)"
        )

    def close(self) -> None:
        """Ends the line."""
        if self._live and self.shown:
            typer.echo("", err=True)
