"""Tuning: parameters of a model from windows of rows, with intervals and verdicts.

`solve` chooses: closed form where outputs are linear in all tuned parameters, variable projection
where they are linear in some, SciPy's least squares elsewhere. `ClosedForm` is the prepared fast
path, `Recursive` the one in the stream, `Iteration` the axis-by-axis rounds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.tuning.advice import advise
    from evertwin.tuning.closed import ClosedForm, Solution
    from evertwin.tuning.fit import Fit, Residual
    from evertwin.tuning.identifiability import Gate, connected, gate
    from evertwin.tuning.iteration import Iterated, Iteration, Round
    from evertwin.tuning.problem import Problem
    from evertwin.tuning.recursive import Recursive, RecursiveRows, RecursiveState
    from evertwin.tuning.schedule import Schedule, weights_from_growth
    from evertwin.tuning.settings import Far, Settings
    from evertwin.tuning.solver import solve
    from evertwin.tuning.statistics import Dependence
    from evertwin.tuning.unseen import held_out

__all__ = [
    "ClosedForm",
    "Dependence",
    "Far",
    "Fit",
    "Gate",
    "Iterated",
    "Iteration",
    "Problem",
    "Recursive",
    "RecursiveRows",
    "RecursiveState",
    "Residual",
    "Round",
    "Schedule",
    "Settings",
    "Solution",
    "advise",
    "connected",
    "gate",
    "held_out",
    "solve",
    "weights_from_growth",
]

__getattr__ = surface(__name__)
