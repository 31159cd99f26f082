"""Rows on which a sensor was in error, as far as the log tells of them by now.

A fault is found out some rows after it began: until then its rows were believed, and what is off on
them is the sensor's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from evertwin.models import Model
from evertwin.outcome.open.faults import lasts
from evertwin.types import Bool

KEPT = 64
"""Faults of a signal that are over whose rows are known."""


class Faults:
    """Of the outputs of one twin.

    >>> faults, about = Faults(), {"cause": "frozen", "onset": 3, "end": 9}
    >>> faults.heard("measurement_error", "x", 9, about)
    >>> faults.spans["x", False]
    [(3, None)]
    >>> faults.heard("measurement_restored", "x", 20, about)
    >>> faults.spans["x", False]
    [(3, 20)]
    """

    def __init__(self) -> None:
        self.spans: dict[tuple[str, bool], list[tuple[int, int | None]]] = {}
        """Signal, and whether another one told: first row, and the last whose prediction began with
        it; None: it goes on."""

    def heard(self, kind: str, signal: str, row: int, about: Mapping[str, Any]) -> None:
        """An event, and its evidence."""
        if kind == "started":  # rows are counted anew
            self.spans.clear()
        if kind not in ("measurement_error", "measurement_restored"):
            return
        known = self.spans.setdefault((signal, about.get("cause") == "kinematics"), [])
        if kind == "measurement_error":
            first = about.get("first", about.get("onset", row))
            known.append((first, None if lasts(about, row) else about.get("end", row)))
            del known[:-KEPT]
        else:
            known[:] = [(first, row if stop is None else stop) for first, stop in known]

    def at(self, rows: np.ndarray, model: Model) -> Bool[np.ndarray, "n ny"]:
        """Which outputs of ``rows``, by number, tell nothing of the machine: those that it gave,
        and all while it goes on, for what is off cannot be told then."""
        outputs = model.outputs
        found = np.zeros((len(rows), len(outputs)), dtype=np.bool_)
        for (signal, _), spans in self.spans.items():
            which = np.array(outputs.names) == signal
            if signal in outputs.groups:
                which |= outputs.group_of == outputs.groups.index(signal)
            for first, stop in spans:
                within = np.full(len(rows), stop is None)
                if stop is not None:
                    within = (rows >= first) & (rows <= stop)
                found |= within[:, None] & which
        return found
