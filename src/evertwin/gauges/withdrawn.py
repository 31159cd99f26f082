"""Kept rows that turn out to be of a sensor's fault, which was found out some rows later."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evertwin.fold import Event
from evertwin.models import Model
from evertwin.rows.ring import Rows, refuse

CAUSES = ("frozen", "factor", "away")
"""Causes that are told of rows since an onset, which were believed until then."""


def withdraw(rows: Rows, events: Sequence[Event], model: Model) -> None:
    """No fit sees the rows of an output from the onset of its fault on. Writes into ``rows``."""
    outputs, nu = model.outputs, len(model.inputs)
    for event in events:
        found: Any = event.evidence
        told = event.kind == "measurement_error" and found.get("cause") in CAUSES
        if told and event.signal in outputs.groups:
            group = outputs.groups.index(event.signal)
            columns = nu + np.flatnonzero(outputs.group_of == group)
            refuse(rows, columns.tolist(), found["onset"], min(found["end"], rows.end - 1))
