"""Which changes of the machine stay within what is asked, so that the twin will not tell them?

A prediction over a minute hardly moves with the heat loss of an oven that takes hours to cool. So
each number is changed, and what that does to the outputs at the horizon is compared with the
requirement; then with a longer horizon.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.errors import EvertwinError
from evertwin.refit.work import Work
from evertwin.signals.spoken import number
from evertwin.tuning import Problem
from evertwin.types import Bools, Float64, Vector

CHANGE = 0.3
"""Share by which a number changes that is worth being told."""
LONGER = (3, 10, 30)
"""Times the horizon that are tried."""
PREDICTIONS = 10
"""Predictions of such a length that the rows hold at least."""
NAMED = 4
"""Numbers that are named."""


def look_hidden(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """Numbers that the rows tell, and whose change stays within the requirement."""
    setup, work = view.setup, Work(view.setup, view.versions)
    told = figures.get("parameters", {})
    names = tuple(
        name for name in work.editable(view.version)
        if told.get(name, {}).get("verdict") == "identifiable" and name not in setup.once
    )  # fmt: skip
    if not names or view.slow or not math.isfinite(setup.requirement):
        return
    values = np.array([told[name]["value"] for name in names])
    try:
        problem = work.problem(view.version, view.spread(view.judged), names).tuning(names)
        by = _moved(view, problem, values)
        hidden = np.flatnonzero((by.max(axis=0) < 1.0) & (by.max(axis=0) > 0.0))
        longer = _longer(view, problem, values, hidden) if len(hidden) else 0.0
    except EvertwinError:  # `look_tuning` says why
        return
    if not len(hidden):
        return
    few = ", ".join(names[k] for k in hidden[:NAMED]) + (" …" if len(hidden) > NAMED else "")
    most = int(hidden[np.argmax(by.max(axis=0)[hidden])])
    output = int(np.argmax(by[:, most]))
    shown = setup.shown(output, by[output, most] * setup.requirement)
    step = "a smaller [anomaly] requirement, as far as the noise allows"
    if longer:
        step = f'[prediction] horizon = "{number(longer, "s")}" shows more of them; or {step}'
    yield Finding(
        "hidden", names[hidden[0]],
        f"a change of {few} by {100 * CHANGE:.0f} % stays within the requirement, so it is not "
        f"told: of {names[most]} it moves {setup.model.outputs.names[output]} by {shown}, where "
        f"{setup.shown(output, setup.requirement)} is asked",
        "[anomaly] requirement, [prediction] horizon", step,
        {"of_requirement": dict(zip(names, by.max(axis=0).tolist(), strict=True)),
         "horizon": longer},
    )  # fmt: skip


def _moved(view: View, problem: Problem, values: Vector) -> Float64[np.ndarray, "ny k"]:
    """What a change of each number does to each output [requirement], (ny, k)."""
    setup = view.setup
    with np.errstate(all="ignore"):
        moved = problem.jacobian(values) * (CHANGE * values)
    counts = problem.rows.moving & _at_ends(problem)[:, None]
    moved = np.where(counts[:, :, None], moved, np.nan)
    rows = np.maximum(np.isfinite(moved).sum(axis=0), 1)
    rms = np.sqrt(np.nansum(np.square(moved), axis=0) / rows)
    size = setup.sizes(np.where(problem.rows.moving, problem.rows.y, np.nan)) * setup.requirement
    return np.asarray(np.where(setup.watched[:, None], rms / size[:, None], 0.0))


def _at_ends(problem: Problem) -> Bools:
    """The rows at which predictions have reached their horizon, (n,); of a map all."""
    code = problem.restart.code
    if not len(problem.model.states) or not np.isfinite(problem.horizon):
        return np.ones(len(code), dtype=np.bool_)
    return np.append(code[1:] != 0, True)


def _longer(view: View, problem: Problem, values: Vector, hidden: np.ndarray) -> float:
    """The shortest horizon of those tried that shows a change of a ``hidden`` one; 0: none does."""
    horizon = view.setup.horizon
    if not (len(problem.model.states) and math.isfinite(horizon)):
        return 0.0
    for times in LONGER:
        if times * horizon * PREDICTIONS > view.seconds:
            break
        longer = replace(problem, horizon=times * horizon)
        if _moved(view, longer, values)[:, hidden].max() >= 1.0:
            return times * horizon
    return 0.0
