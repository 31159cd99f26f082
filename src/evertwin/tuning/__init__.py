"""Tuning: parameters of a model from windows of rows, with intervals and verdicts."""

from evertwin.tuning.closed import ClosedForm, Solution
from evertwin.tuning.fit import Fit, Residual
from evertwin.tuning.identifiability import Gate, connected, gate
from evertwin.tuning.nonlinear import Settings
from evertwin.tuning.problem import Problem
from evertwin.tuning.solve import solve
from evertwin.tuning.statistics import Dependence

__all__ = [
    "ClosedForm",
    "Dependence",
    "Fit",
    "Gate",
    "Problem",
    "Residual",
    "Settings",
    "Solution",
    "connected",
    "gate",
    "solve",
]
