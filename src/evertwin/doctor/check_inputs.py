"""Is an input what was commanded, or what was measured at the row?

A command acts from its stamp on, so a row is predicted with the one before; a measured input is
that of the row. One that is taken for the other is a row late, which no number of the model makes
good. Both readings are tuned and compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from evertwin.doctor.check_numbers import changed, tuned
from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.fold import Block

CLEAR = 0.5
"""Largest share of the squared deviation that the other reading leaves."""
LEVELS = 10
"""Values of an input from which it may be measured: a switch is commanded."""


def look_inputs(view: View) -> Iterator[Finding]:
    """Inputs of a model with states that the twin file says nothing of, read as measured."""
    rules, before = view.setup.spec.signals, math.nan
    for k, channel in enumerate(view.model.inputs if not view.setup.static else ()):
        told = channel.name in rules and rules[channel.name].hold is not None
        if told or len(np.unique(np.concatenate([w.u[:, k] for w in view.judged]))) < LEVELS:
            continue
        before = _left(view, lambda window: window) if math.isnan(before) else before
        share = _left(view, partial(_at_the_row, k=k)) / before if before > 0.0 else 1.0
        if share < CLEAR:
            yield Finding(
                "command", channel.name,
                f"{channel.name} of the row predicts better than that of the row before: "
                f"{100 * (1 - share):.0f} % of the squared deviation is gone",
                f"[signals.{channel.name}] hold",
                "hold = false, if it is measured: a command (hold = true) acts from its stamp on",
                {"share": share},
            )  # fmt: skip


def _at_the_row(window: Block, k: int) -> Block:
    u = window.u.copy()
    u[:-1, k] = u[1:, k]
    return window._replace(u=u)


def _left(view: View, reading: Callable[[Block], Block]) -> float:
    """Squared deviation of the tuned numbers, each output by its size, over the watched ones."""
    p, total = tuned(view, reading), 0.0
    for window in view.some(view.judged):
        found = changed(view, p, reading(window))
        total += float(np.sum(np.square(found.mismatch[view.setup.watched])))
    return total
