"""Terms that act on a pose in the plane: states x, y, heading that are measured as such."""

from __future__ import annotations

import numpy as np

from evertwin.errors import UsageError
from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.terms.contract import CorrectionTerm, Intervals, told
from evertwin.models.terms.rows import Rows
from evertwin.signals.channels import Layout

POSE = ("x", "y", "heading")


class PoseTerm(CorrectionTerm):
    """Its channel is the whole pose (``*``); the outputs that show it follow.

    >>> PoseTerm.rank
    4
    """

    rank = 4

    def check(self, term: Term, model: Model) -> None:
        if min(posed(model.states), posed(model.outputs)) < 0:
            raise UsageError(
                f"{self.kind}: expected a model whose states and outputs hold a pose "
                f"{', '.join(POSE)}, got {model.states.names} and {model.outputs.names}"
            )
        super().check(term, model)

    def channel(self, term: Term, model: Model) -> int:
        return posed(model.states)

    def unit(self, term: Term, model: Model) -> str:
        return "m"

    def extra(self, term: Term, model: Model) -> int:
        """The first of the outputs that show the pose."""
        return posed(model.outputs)


def posed(layout: Layout) -> int:
    """Where a pose begins; −1: there is none.

    >>> posed(Layout.of(a="m", x="m", y="m", heading="rad")), posed(Layout.of(x="m"))
    (1, -1)
    """
    names = layout.names
    at = names.index(POSE[0]) if POSE[0] in names else len(names)
    return at if names[at : at + len(POSE)] == POSE else -1


def way(rows: Rows) -> float:
    """The way over a horizon, root mean square [m]; 0 where the model has no pose, or none moves.

    >>> from evertwin.fold import make_block
    >>> from evertwin.machines.mobile import Differential
    >>> y = np.arange(9.0)[:, None] * [3.0, 4.0, 0.0]
    >>> block = make_block(t=np.arange(9) * 10**9, u=np.zeros((9, 2)), y=y)
    >>> way(Rows(Differential(), (block,), (), 2.0))
    10.0
    """
    at = posed(rows.model.outputs)
    if min(at, posed(rows.model.states)) < 0:
        return 0.0
    squares = [np.zeros(0)]
    for window in rows.windows:
        place = window.y[:, at : at + 2]
        known = np.isfinite(place).all(axis=1)
        t, place = window.t[known], place[known]
        later = np.searchsorted(t, t + round(rows.horizon * 1e9))
        begun = np.flatnonzero(later < len(t))
        squares.append(np.square(place[later[begun]] - place[begun]).sum(axis=1))
    found = np.concatenate(squares)
    return float(np.sqrt(found.mean())) if len(found) else 0.0


def sized(name: str, value: float, unit: str, intervals: Intervals) -> str:
    """A number of either sign, told by its size.

    >>> sized("ahead", -0.2, "m", {"ahead": (-0.3, -0.1)})
    '0.2 (0.1 to 0.3) m'
    """
    if value < 0.0 and name in intervals:
        low, high = intervals[name]
        intervals = {name: (-high, -low)}
    return told(name, abs(value), unit, intervals)
