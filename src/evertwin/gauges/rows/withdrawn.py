"""Kept rows that turn out to be of a sensor's fault, which was found out some rows later."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evertwin.fold import Event
from evertwin.models import Model
from evertwin.rows.ring import Rows, refuse, reread

CAUSES = ("frozen", "factor", "away")
"""Causes that are told of rows since an onset, which were believed until then."""


def withdraw(rows: Rows, events: Sequence[Event], model: Model) -> None:
    """No fit sees the rows of an output from the onset of its fault on, nor an input as it was
    recorded in another unit. Writes into ``rows``."""
    for event, outputs in believed(events, model):
        found: Any = event.evidence
        columns = [len(model.inputs) + k for k in outputs]
        refuse(rows, columns, found["onset"], min(found["end"], rows.end - 1))
    for event, column in divided(events, model):
        found = event.evidence
        reread(rows, column, found["factor"], found["onset"])


def believed(events: Sequence[Event], model: Model) -> list[tuple[Event, list[int]]]:
    """Events of such faults, and the outputs that they are of."""
    outputs = model.outputs
    return [
        (event, np.flatnonzero(outputs.group_of == outputs.groups.index(event.signal)).tolist())
        for event in events
        if event.kind == "measurement_error" and event.evidence.get("cause") in CAUSES
        and event.signal in outputs.groups
    ]  # fmt: skip


def divided(events: Sequence[Event], model: Model) -> list[tuple[Event, int]]:
    """Events of inputs that are off by a factor, and their columns."""
    return [
        (event, model.inputs.index(event.signal))
        for event in events
        if event.kind == "measurement_error" and "factor" in event.evidence
        and event.signal in model.inputs.names
    ]  # fmt: skip
