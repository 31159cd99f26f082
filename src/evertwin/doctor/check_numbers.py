"""Do the numbers of a model describe the machine at all, or has nobody stated them yet?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.errors import DataError, ModelError, UsageError
from evertwin.fold import Block
from evertwin.gauges.rows.unlike import Changes, changes
from evertwin.refit.numbers.physical import physically
from evertwin.refit.work import Work
from evertwin.tuning import solve, told_apart
from evertwin.types import ParameterVector, Vector

BETTER = 0.5
"""Share of what is missed that tuned numbers leave at most, where those that are told are none."""
DECADE = 1.0
"""Powers of ten by which a number without a unit may be off: it says itself how large it is."""
NAMED = 4
"""Numbers that are named."""


def tuned(
    view: View, change: Callable[[Block], Block], rows: tuple[Block, ...] | None = None
) -> ParameterVector:
    """What the changed rows, else those that were judged, tune the numbers to; the version's where
    they cannot be tuned. Of a static map only what they leave is asked."""
    work, p = Work(view.setup, view.versions), view.version.p
    windows = tuple(change(window) for window in view.spread(rows or view.judged))
    try:
        names = work.editable(view.version)
        problem = work.problem(view.version, windows, names)
        problem = replace(problem, settings=replace(problem.settings, quick=view.setup.static))
        return (
            physically(problem, lambda one: (told_apart(one, solve(one)), {}))[0].p if names else p
        )
    except (DataError, ModelError, UsageError):  # `look_tuning` says why
        return p


def changed(view: View, p: ParameterVector, window: Block) -> Changes:
    """How unlike the changes over the horizon are, measured and predicted with numbers ``p``."""
    with np.errstate(all="ignore"):
        return changes(view.model, p, window, view.horizon)


def not_tuned(
    view: View, window: Block, p: ParameterVector, missed: tuple[Vector, Vector]
) -> Iterator[Finding]:
    """That the tuned numbers ``p`` of a model with states, (np,), explain far more: then a unit is
    not to blame.

    Args:
        missed: mismatch with the numbers as they are, and with the best factor, (ny,) each.
    """
    old, named = view.version.p, view.model.parameters
    pure = np.array([one.unit == "1" for one in named]) & (old != 0.0)
    with np.errstate(all="ignore"):
        far = np.abs(np.log10(np.abs(p[pure] / old[pure]))) > DECADE
    left = changed(view, p, window).mismatch
    names = [name for name, a, b in zip(named.names, old, p, strict=True) if a != b]
    if not names or far.any() or not left.sum() < BETTER * missed[1].sum():
        return
    yield Finding(
        "not_tuned", names[0],
        f"with the numbers as they are {100 * missed[0].max():.0f} % of the changes of an output "
        f"are missed, tuned {100 * left.max():.0f} %: what is told below may come of them",
        "[model.parameters]",
        f"evertwin fit --keep, or give {', '.join(names[:NAMED])} better values; then ask again",
        {"tuned": dict(zip(named.names, p.tolist(), strict=True)), "after": left},
    )  # fmt: skip
