"""Tuning: parameters of a model from windows of rows, with intervals and verdicts.

`solve` chooses: closed form where outputs are linear in all tuned parameters, variable projection
where they are linear in some, SciPy's least squares elsewhere. `ClosedForm` is the prepared fast
path, `Recursive` the one in the stream, `Iteration` the axis-by-axis rounds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.tuning.advice import advise as advise
    from evertwin.tuning.closed import ClosedForm as ClosedForm, Solution as Solution
    from evertwin.tuning.collinear import told_apart as told_apart
    from evertwin.tuning.fit import Fit as Fit, Residual as Residual
    from evertwin.tuning.following import Following as Following, FollowingState as FollowingState
    from evertwin.tuning.form_error import carried as carried
    from evertwin.tuning.identifiability import Gate as Gate, connected as connected, gate as gate
    from evertwin.tuning.iteration import (
        Iterated as Iterated,
        Iteration as Iteration,
        Round as Round,
    )
    from evertwin.tuning.omitted import moved as moved
    from evertwin.tuning.problem import Problem as Problem
    from evertwin.tuning.recordings import (
        initials as initials,
        own_names as own_names,
        started as started,
    )
    from evertwin.tuning.recursive import (
        Recursive as Recursive,
        RecursiveRows as RecursiveRows,
        RecursiveState as RecursiveState,
    )
    from evertwin.tuning.repeats import repeated as repeated
    from evertwin.tuning.routes import Route as Route, beside as beside, shown as shown
    from evertwin.tuning.schedule import (
        Schedule as Schedule,
        weights_from_growth as weights_from_growth,
    )
    from evertwin.tuning.settings import Far as Far, Settings as Settings
    from evertwin.tuning.solver import solve as solve
    from evertwin.tuning.statistics import Dependence as Dependence
    from evertwin.tuning.unseen import held_out as held_out

__getattr__ = surface(__name__)
