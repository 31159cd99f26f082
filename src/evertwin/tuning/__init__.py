"""Tuning: parameters of a model from windows of rows, with intervals and verdicts.

`solve` chooses: closed form where outputs are linear in all tuned parameters, variable projection
where they are linear in some, SciPy's least squares elsewhere. `ClosedForm` is the prepared fast
path, `Recursive` the one in the stream, `Iteration` the axis-by-axis rounds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.tuning.form.collinear import told_apart as told_apart
    from evertwin.tuning.form.form_error import carried as carried
    from evertwin.tuning.form.omitted import moved as moved
    from evertwin.tuning.form.repeats import repeated as repeated
    from evertwin.tuning.form.routes import Route as Route, beside as beside, shown as shown
    from evertwin.tuning.form.unseen import held_out as held_out
    from evertwin.tuning.intervals.advice import advise as advise
    from evertwin.tuning.intervals.fit import Fit as Fit, Residual as Residual
    from evertwin.tuning.intervals.identifiability import (
        Gate as Gate,
        connected as connected,
        gate as gate,
    )
    from evertwin.tuning.iteration import (
        Iterated as Iterated,
        Iteration as Iteration,
        Round as Round,
    )
    from evertwin.tuning.linear.closed import ClosedForm as ClosedForm, Solution as Solution
    from evertwin.tuning.posing.problem import Problem as Problem
    from evertwin.tuning.posing.recordings import (
        initials as initials,
        own_names as own_names,
        started as started,
    )
    from evertwin.tuning.posing.settings import Far as Far, Settings as Settings
    from evertwin.tuning.residuals.statistics import Dependence as Dependence
    from evertwin.tuning.schedule import (
        Schedule as Schedule,
        weights_from_growth as weights_from_growth,
    )
    from evertwin.tuning.solver import solve as solve
    from evertwin.tuning.stream.following import (
        Following as Following,
        FollowingState as FollowingState,
    )
    from evertwin.tuning.stream.recursive import (
        Recursive as Recursive,
        RecursiveRows as RecursiveRows,
        RecursiveState as RecursiveState,
    )

__getattr__ = surface(__name__)
