"""What do the rows determine? Identifiability, knobs without effect, start values on bounds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.errors import DataError, ModelError, UsageError
from evertwin.fold import Block
from evertwin.loop.setup import Setup
from evertwin.loop.versions import Versions
from evertwin.loop.work import Work
from evertwin.models import Model
from evertwin.models.configured import configured
from evertwin.models.form import Version
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.advice import advise
from evertwin.tuning.identifiability import connected


def look_bounds(setup: Setup, versions: Versions, version: Version) -> Iterator[Finding]:
    """Start values that lie on a bound of theirs."""
    model = versions.model(version.number)
    parameters = model.parameters.with_values(version.p)
    for name in Work(setup, versions).editable(version):
        item = parameters[name]
        side = "lower" if item.value == item.low else "upper" if item.value == item.high else ""
        if side:
            yield Finding(
                "at_bound", name,
                f"{name} starts on its {side} bound, {item.value:g} {item.unit}",
                f"[model.parameters.{name}]",
                "start inside, or move the bound: on a bound its effect is seen from one side only",
                {"value": item.value, "low": item.low, "high": item.high},
            )  # fmt: skip


def look_tuning(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """Which editable parameters these rows determine, and what would determine the others."""
    work = Work(view.setup, view.versions)
    windows = view.some(view.judged)
    u = np.concatenate([window.u for window in windows])
    model, names = _live(view), []
    for name in work.editable(view.version):
        reason = _disconnected(model, name, u)
        if reason:
            yield Finding(
                "not_connected", name, reason, f"[tuning] editable, {name}",
                "take it out of [tuning] editable, or look where the model uses it", {},
            )  # fmt: skip
        else:
            names.append(name)
    if not names:
        return
    fit, reason = _fitted(work, view, windows, tuple(names))
    if fit is None:
        yield Finding(
            "not_possible", "tuning", reason, "[tuning]",
            "the rows that count are too few or too short: give more data, or check [filter], "
            "[clock] crop and [moving]", {},
        )  # fmt: skip
        return
    figures["parameters"] = fit.to_dict(timing=False)["parameters"]
    figures["condition"] = fit.condition
    yield from _undetermined(view, fit, u)


def _live(view: View) -> Model:
    """The model at the version's own values: a term at its start values may do nothing."""
    return configured(view.model, parameters=view.model.parameters.with_values(view.version.p))


def _disconnected(model: Model, name: str, u: np.ndarray) -> str:
    try:
        connected(model, (name,), u)
    except ModelError as error:
        return str(error)
    return ""


def _fitted(
    work: Work, view: View, windows: tuple[Block, ...], names: tuple[str, ...]
) -> tuple[Fit | None, str]:
    try:
        problem: Problem = work.problem(view.version, windows, names)
        return solve(problem), ""
    except (DataError, ModelError, UsageError) as error:
        return None, str(error)


def _undetermined(view: View, fit: Fit, u: np.ndarray) -> Iterator[Finding]:
    """One finding for parameters that cannot be told for the same reason."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name, verdict, reason in zip(fit.names, fit.verdict, fit.reasons, strict=True):
        if verdict != "identifiable":
            groups.setdefault((verdict, reason), []).append(name)
    model = _live(view)
    for (verdict, reason), names in groups.items():
        motion = advise(model, names, u)
        step = (
            "record " + ", then ".join(motion)
            if motion
            else "keep it fixed (take it out of [tuning] editable), or give its prior (sigma)"
        )
        kept = "keeps its value" if verdict == "not" else "is tuned, with a wide interval"
        yield Finding(
            "not_identifiable" if verdict == "not" else "weak", names[0],
            f"{', '.join(names)} {kept}: {reason}", f"rows 0 to {len(u) - 1}", step,
            {"parameters": names, "verdict": verdict, "motion": motion},
        )  # fmt: skip
