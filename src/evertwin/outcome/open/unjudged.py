"""What of a recording was not judged, because nothing was measured or an input was not known."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from evertwin.models import hidden_of, observed
from evertwin.rows.channels import is_measured
from evertwin.setup.setup import Setup
from evertwin.types import Bools, Vector

MUCH = 0.1
"""Share of the rows from which on it is told."""
PREDICTED = "Without a value of {}, nothing was predicted"
JUDGED = "Without a value, nothing of {} was judged"
LONG = 4.0
"""Rows without a measurement, by the usual ones, from which on one is missing."""
WHITE = 1.2
"""Scatter of all rows by that from row to row, up to which it is nothing but noise."""


def unjudged(setup: Setup, trace: Mapping[str, np.ndarray]) -> str:
    """A sentence for each part of the rows in which a channel is missing; nothing: none is.

    Args:
        setup: of the twin.
        trace: rows of the run: ``row`` (n,), ``input`` (n, nu), ``measured`` (n, ny).
    """
    if not trace or not len(trace["row"]):
        return ""
    rows, found = trace["row"], dict[tuple[str, bytes], list[str]]()
    whole = bool((np.diff(rows) == 1).all())
    for k, name in enumerate(setup.model.inputs.names):
        away = np.isnan(trace["input"][:, k])
        found.setdefault((PREDICTED, away.tobytes()), []).append(name)
    for k, name in enumerate(setup.model.outputs.names):
        away = _missing(trace["measured"][:, k], whole)
        if is_measured(setup.spec, name):
            found.setdefault((JUDGED, away.tobytes()), []).append(name)
    said = []
    for (text, key), names in found.items():
        places = np.flatnonzero(np.frombuffer(key, dtype=np.bool_))
        if len(places) >= max(MUCH * len(rows), 1):
            share, first, last = len(places) / len(rows), rows[places[0]], rows[places[-1]]
            part = f"in {100 * share:.0f} % of the rows (row {first} to {last})"
            said.append(f"{text.format(', '.join(names))} {part if share < 1.0 else 'in any row'}.")
    return " ".join(said)


def none_judged(setup: Setup, measured: int, short: int) -> str:
    """Why no output has a figure, of so many rows that measure one; ``short``: too few of them."""
    said = "Nothing was predicted"
    if not measured:
        return f"{said}: no output has a measurement to be compared with."
    if measured < short:
        rows = f"{measured} row{'s are' if measured > 1 else ' is'}"
        return f"{said}: {rows} too few, for filters and predictions need some before they begin."
    if hidden := hidden_of(observed(setup.model)):
        names = ", ".join(setup.model.states.names[k] for k in hidden)
        ends = "never ends" if math.isinf(setup.horizon) else f"takes {setup.horizon:g} s"
        return (
            f"Nothing was judged: by the first prediction behind a start what nothing measures "
            f"({names}) is estimated, and it {ends}: set [prediction] horizon to how far ahead "
            "the twin is to be right."
        )
    return (
        f"{said}: no row has all its inputs, and a measurement that counts (evertwin doctor says "
        "why)."
    )


def at_rest(trace: Mapping[str, np.ndarray]) -> bool:
    """Were all inputs zero, and all outputs nothing but noise about one value, in all rows? Then
    no number of the model had anything to say.

    >>> scatter = np.random.default_rng(0).normal(0.0, 1e-3, (500, 1))
    >>> still = {"input": np.zeros((500, 1)), "measured": 2.0 + scatter}
    >>> at_rest(still), at_rest({**still, "measured": scatter.cumsum(axis=0)})
    (True, False)
    """
    u, y = trace.get("input", np.zeros((0, 0))), trace.get("measured", np.zeros((0, 0)))
    if not u.size or not y.size or np.any(u[np.isfinite(u)] != 0.0):
        return False
    columns = [column[np.isfinite(column)] for column in y.T]
    known = [column for column in columns if len(column) > 2]
    return bool(known) and all(
        np.std(column) <= WHITE * np.std(np.diff(column)) / np.sqrt(2.0) for column in known
    )


def _missing(measured: Vector, whole: bool) -> Bools:
    """Rows of a stretch without a measurement that is far longer than usual, (n,); ``whole``: are
    these all rows? Of every second one, or fewer, an output may be measured at the others."""
    away: Bools = np.isnan(measured)
    known = np.flatnonzero(~away)
    if not len(known):
        return np.full(len(away), whole)
    usual = float(np.median(np.diff(known))) if len(known) > 1 else 1.0
    before = np.concatenate([[-1], known, [len(away)]])
    for a, b in zip(before[:-1].tolist(), before[1:].tolist(), strict=True):
        if b - a <= LONG * usual:
            away[a + 1 : b] = False
    return away
