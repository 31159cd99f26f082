"""``evertwin confusions --drift``: new labels, read or as they come, against those known."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer

from evertwin.app.console import show
from evertwin.errors import DataError, UsageError
from evertwin.features.images.confusion_drift import ConfusionDrift
from evertwin.features.images.labelled import numbers_of, read_alone, with_others
from evertwin.fold import Chunk, Event, plain
from evertwin.sources.texts.small_table import Table, parse, read_table

STDIN = "-"


def show_drift(
    files: Sequence[Path], rule: tuple[float, float | None], as_json: bool, check: bool
) -> None:
    """``evertwin confusions --drift``; ``rule``: labels for one false event, and the least
    probability of a label. What comes on stdin is told as it comes, with ``as_json`` a document a
    line.

    Raises:
        UsageError: a number that is none, or of other than two files.
    """
    per, least = rule
    if not per >= 1:
        raise UsageError(f"--drift: expected 1 label or more for one false event, got {per:g}")
    if len(files) != 2:
        raise UsageError(f"--drift: expected known labels and new ones, got {len(files)} files")
    known = with_others(read_alone(files[0], least))
    stage = ConfusionDrift(str(files[1]), known, per)
    state, groups, events, live = stage.init(), dict[str, int](), list[Event](), _is_live(files[1])
    at = 0
    for table in _tables(files[1]):
        rows = numbers_of(table, known, groups, least)
        for row in rows:
            state, out = stage.step(state, Chunk(stage.source, np.array([at]), row[None]))
            at += 1
            for record in out.records:
                if isinstance(record, Event):
                    events.append(record)
                    _tell(record, as_json, live)
    drifted = [
        {"truth": known.classes[i], "label": known.classes[j]}
        for i, j in np.argwhere(state.told > 0).tolist() if i != j
    ]  # fmt: skip
    content: dict[str, Any] = {
        "schema": "evertwin.confusions_drift/1", "known": len(known.truth), "labels": state.came,
        "per": per, "events": [_content(event) for event in events], "drifted": drifted,
    }  # fmt: skip
    if not (live and as_json):
        show(content, _text(content, events, live=live), as_json)
    if check and drifted:
        raise typer.Exit(1)


def _is_live(file: Path) -> bool:
    return str(file) == STDIN


def _tables(file: Path) -> Iterator[Table]:
    """A file whole, or what comes on stdin line by line.

    Raises:
        DataError: nothing came.
    """
    if not _is_live(file):
        yield read_table(file)
        return
    head = sys.stdin.readline()
    if not head:
        raise DataError("stdin: expected a line of headings, got nothing")
    for line in sys.stdin:
        if line.strip():
            yield parse([head, line], "stdin")


def _content(event: Event) -> dict[str, Any]:
    return {"label": event.time + 1, "kind": event.kind, "reason": event.reason,
            "evidence": event.evidence}  # fmt: skip


def _tell(event: Event, as_json: bool, live: bool) -> None:
    """An event, when it happens."""
    if live:
        line = json.dumps(plain(_content(event)), allow_nan=False) if as_json else _line(event)
        typer.echo(line)
        sys.stdout.flush()


def _line(event: Event) -> str:
    return f"label {event.time + 1}: {event.kind}: {event.reason}"


def _text(content: dict[str, Any], events: Sequence[Event], *, live: bool) -> str:
    cells = [f"{one['truth']} taken for {one['label']}" for one in content["drifted"]]
    said = f"no longer as known: {', '.join(cells)}" if cells else "nothing is other than known"
    lines = [] if live else [_line(event) for event in events]
    count = f"{content['labels']} labels against {content['known']} known"
    return "\n".join([*lines, f"{count}: {said}"])
