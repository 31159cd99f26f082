"""What the command ``evertwin label`` does."""

from __future__ import annotations

import getpass
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

from evertwin.app.console import show
from evertwin.app.opening import store_path, to_work
from evertwin.errors import UsageError
from evertwin.fold import plain
from evertwin.ledger.label import Label, Verdict

NEAR = 5
"""Numbers of events that are named."""


def label_event(
    twin: Path, number: int, verdict: str, reason: str, about: tuple[str, str], as_json: bool
) -> None:  # fmt: skip
    """``evertwin label``; ``about``: the cause that is named, and the rows that are faulty.

    Raises:
        UsageError: the verdict, or what goes with it, is none.
    """
    if verdict not in get_args(Verdict):
        raise UsageError(f"verdict {verdict!r}: expected {', '.join(get_args(Verdict))}")
    chosen: Any = verdict
    said = Label(number, chosen, reason, getpass.getuser(), about[0], _rows(about[1]))
    with to_work(twin, telling=True) as opened:
        store_path(twin, opened.spec)
        _look_up(twin, number, [entry.number for entry in opened.store.entries(kinds=("event",))])
        event = opened.label(said)
        show({"schema": "evertwin.event/1", "event": plain(event)}, event.reason, as_json)


def _look_up(twin: Path, number: int, there: Sequence[int]) -> None:
    """Is it the number of an event?

    Raises:
        UsageError: it is none; with those nearest to it.
    """
    if number in there:
        return
    near = ", ".join(map(str, sorted(sorted(there, key=lambda n: abs(n - number))[:NEAR])))
    said = f"evertwin events {twin} lists them, the nearest are {near}" if there else "it has none"
    raise UsageError(f"label: the log has no event {number}; {said}")


def _rows(text: str) -> tuple[int, int] | None:
    """Rows as FIRST:LAST.

    >>> _rows("40:90"), _rows("")
    ((40, 90), None)

    Raises:
        UsageError: they are not written so.
    """
    if not text:
        return None
    first, _, last = text.partition(":")
    try:
        return int(first), int(last)
    except ValueError as error:
        raise UsageError(f"--rows {text}: expected FIRST:LAST, such as 40:90") from error
