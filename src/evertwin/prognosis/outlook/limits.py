"""Where a life ends: by hand, where the process would feel it, or by the breakdown.

A demand on accuracy becomes a limit of a parameter with the twin: the newest task is simulated with
more and more of it until the output leaves its tolerance. The limit is the value at which it does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import scipy

from evertwin.ahead.basis import Future
from evertwin.config.prognosis import IndicatorSpec
from evertwin.engineering.breakdown import read_breakdown
from evertwin.errors import ConfigError, UsageError
from evertwin.models import Model
from evertwin.prognosis.laws import Limit
from evertwin.signals import wrap
from evertwin.signals.units import from_si
from evertwin.types import ParameterVector

DOUBLINGS = 60
"""Steps after which no limit is found."""


def limit_of(rule: IndicatorSpec, broken_down: Mapping[str, Limit], felt: float | None) -> Limit:
    """The limit of an indicator: by hand, by accuracy (``felt``), or by the breakdown; in its unit.

    Raises:
        ConfigError: nothing says where its life ends.
    """
    found = _limit(rule, broken_down, felt)
    return replace(found, value=float(from_si(found.value, rule.unit))) if rule.unit else found


def _limit(rule: IndicatorSpec, broken_down: Mapping[str, Limit], felt: float | None) -> Limit:
    """The same in SI, as settings are."""
    if rule.limit is not None:
        return Limit(rule.limit, rule.direction, "by hand")
    if rule.accuracy is not None:
        demand = rule.accuracy
        share = f"{100 * demand.tolerance:g} % of its rms" if demand.relative else "the tolerance"
        said = f"{demand.output} changes by {share} ({demand.tolerance:g})"
        if felt is None:
            raise ConfigError(
                f"indicator {rule.name}: {rule.parameter} never takes {demand.output} out of its "
                "tolerance within its bounds: widen the bounds, or give a limit"
            )
        return Limit(felt, rule.direction, said)
    if rule.parameter is not None and rule.parameter in broken_down:
        return broken_down[rule.parameter]
    raise ConfigError(
        f"indicator {rule.name}: nothing says where its life ends: give a limit, an accuracy, or a "
        "[prognosis] breakdown with a limit for its parameter"
    )


def breakdown_limits(path: Path) -> dict[str, Limit]:
    """Limits of health that a breakdown file gives, by the model's parameter.

    Raises:
        ConfigError: the file does not say what it must.
    """
    machine = read_breakdown(path)
    found = {}
    for component in machine.components:
        for name, part in component.parameters.items():
            if part.limit is None:
                continue
            falls = part.value is not None and part.limit < part.value
            why = f" ({part.limit_reason})" if part.limit_reason else ""
            source = f"breakdown {path.name}: {component.name}{why}"
            side: Literal["above", "below"] = "below" if falls else "above"
            found[machine.parameter_name(component, name)] = Limit(part.limit, side, source)
    return found


def accuracy_limit(
    model: Model, p: ParameterVector, future: Future, rule: IndicatorSpec, new: float
) -> float | None:
    """The value at which the output leaves its tolerance; None: within its bounds never.

    Args:
        model: the live version's model.
        p: its values.
        future: the task that has to stay true.
        rule: indicator of one parameter, with an accuracy.
        new: the parameter's value when the component was new.

    Raises:
        UsageError: the indicator is of no parameter or has no accuracy.
    """
    if rule.accuracy is None or rule.parameter is None:
        raise UsageError(f"indicator {rule.name}: expected a parameter and an accuracy")
    demand, upwards = rule.accuracy, rule.direction == "above"
    at, k = model.parameters.index(rule.parameter), model.outputs.index(demand.output)

    def output(value: float) -> np.ndarray:
        q = p.copy()
        q[at] = value
        return np.asarray(model.simulate(model.initial(q), future.u, future.dt, q)[1])

    fresh = output(new)
    size = float(np.sqrt(np.mean(fresh[:, k] ** 2)))
    tolerance = demand.tolerance * size if demand.relative else demand.tolerance

    def beyond(value: float) -> float:
        apart = wrap(output(value) - fresh, model.outputs.angles)[:, k]
        return float(np.sqrt(np.mean(apart**2))) - tolerance

    item = model.parameters[rule.parameter]
    end = item.high if upwards else item.low
    step = max(abs(new), 1e-6) * (1e-3 if upwards else -1e-3)
    for _ in range(DOUBLINGS):
        far = min(new + step, end) if upwards else max(new + step, end)
        if beyond(far) > 0.0:
            return float(scipy.optimize.brentq(beyond, new, far, xtol=1e-12 * max(abs(new), 1.0)))
        if far == end or not math.isfinite(far):
            return None
        step *= 2.0
    return None
