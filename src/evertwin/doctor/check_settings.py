"""Do the settings fit the data? Horizon, tolerance and requirement against noise; action space.

The noise of an output that the model adopts follows from predictions of one row each: successive
residuals share one measurement with opposite sign, so neighbouring differences of residuals have
the covariance −4·σ². Of a static map it is what two neighbouring residuals do not share, or two
neighbouring measurements where the model is further off than they move.

And what do the rows determine? Identifiability, knobs without effect, start values on bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from evertwin.correction.translation.command_effect import command_effects
from evertwin.correction.translation.sarsa_settings import findings
from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.errors import DataError, ModelError, UsageError
from evertwin.fold import Block
from evertwin.gauges.changes.noise import floor, noise
from evertwin.gauges.rows.unlike import changes
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.configured import configured
from evertwin.models.form import Version
from evertwin.refit.answers.correcting import sarsa_settings
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.sources.columns.names import listed
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.intervals.advice import advise
from evertwin.tuning.intervals.identifiability import connected
from evertwin.types import Inputs, Vector

LITTLE = 0.1
"""Share of the command that must be missed before a table has something to learn."""
SHARED = 0.7
"""Correlation of two estimates from which on one parameter hides in the other."""
CLEAR = 3.0
"""Changes over the horizon should be so many times what noise alone makes of them."""


def look_settings(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """What is set, against what the data is like."""
    found = noise(view.setup, view.model, view.version.p, view.some(view.judged))
    figures["noise"] = dict(zip(view.model.outputs.names, found.tolist(), strict=True))
    yield from _horizon(view, found)
    yield from _tolerance(view, found)
    yield from _requirement(view, found)
    yield from _actions(view)


def _horizon(view: View, level: Vector) -> Iterator[Finding]:
    horizon, least = view.setup.horizon, view.setup.spec.trial.segments
    if not math.isfinite(horizon):
        return
    segments = int(view.seconds / horizon)
    if segments < least:
        yield Finding(
            "horizon", "prediction.horizon",
            f"{view.seconds:.4g} s hold {segments} predictions of {horizon:.4g} s, a trial needs "
            f"{least} or more", "[prediction] horizon",
            "more data, or a shorter horizon: nothing can be promoted with these rows",
            {"segments": segments},
        )  # fmt: skip
    if view.setup.static:
        return
    ratios = {}
    moved = [changes(view.model, view.version.p, w, horizon).measured for w in view.simulated]
    for k, channel in enumerate(view.model.outputs):
        steps = np.concatenate([np.abs(m[np.isfinite(m[:, k]), k]) for m in moved])
        least = math.sqrt(2) * level[k]
        if len(steps) and least > 0 and view.setup.watched[k]:
            ratios[channel.name] = float(np.quantile(steps, 0.95)) / least
    if ratios and max(ratios.values()) < CLEAR:
        name, ratio = max(ratios.items(), key=lambda item: item[1])
        yield Finding(
            "horizon", "prediction.horizon",
            f"over {horizon:.4g} s {name} changes by {ratio:.1f} times what noise makes of it",
            "[prediction] horizon",
            f"a longer horizon, {CLEAR / max(ratio, 0.1) * horizon:.2g} s or more: as it is, "
            "noise decides which model is better", ratios,
        )  # fmt: skip


def _tolerance(view: View, level: Vector) -> Iterator[Finding]:
    rule = view.setup.spec.arbiter
    if rule.use != "tolerance":
        return
    for k, channel in enumerate(view.model.outputs):
        limit = rule.tolerance_angle if channel.kind == "angle" else rule.tolerance
        if np.isfinite(limit) and limit < CLEAR * level[k]:
            yield Finding(
                "tolerance", channel.name,
                f"the tolerance of {channel.name}, {limit:.3g} {channel.unit}, is within "
                f"{CLEAR:g} standard deviations of its noise, {level[k]:.3g}",
                "[arbiter] tolerance",
                "a larger tolerance: noise alone makes position updates", {"noise": level[k]},
            )  # fmt: skip


def _requirement(view: View, level: Vector) -> Iterator[Finding]:
    setup = view.setup
    least_of = floor(setup, level, view.windows)
    if not setup.decides:
        known = np.flatnonzero(setup.watched & np.isfinite(least_of)).tolist()
        names = setup.model.outputs.names
        noise_makes = listed([f"{names[k]} {setup.shown(k, least_of[k])}" for k in known])
        yield Finding(
            "not_asked", "requirement",
            "no requirement is set: nothing is judged, tuned or corrected",
            "[anomaly] requirement",
            f"say how far the twin may be off, above what noise makes of it ({noise_makes})",
        )  # fmt: skip
    if not math.isfinite(setup.requirement):
        return
    for k, least in enumerate(least_of):
        if setup.watched[k] and least > setup.requirement:
            name = setup.model.outputs.names[k]
            yield Finding(
                "requirement", name,
                f"the requirement {setup.shown(k, setup.requirement)} lies below the noise of "
                f"{name}, {setup.shown(k, least)}", "[anomaly] requirement",
                "a larger requirement, or a [filter]: no model can reach it", {"floor": least},
            )  # fmt: skip


def _actions(view: View) -> Iterator[Finding]:
    """Does the action space of a table cover what is observed?"""
    rule = view.setup.spec.correction
    channel = rule.translated
    if not channel or view.setup.static or not rule.quantum:  # else it is proposed from the data
        return
    windows, base = view.some(view.judged), view.setup.model
    try:
        command, effect = command_effects(
            base, base.parameters.values, windows, channel, view.setup.horizon
        )
        settings = sarsa_settings(view.setup, channel, windows)
    except (DataError, UsageError):
        return  # too little data for a table: the horizon's finding says so
    missed = float(np.sqrt(np.mean((effect - command) ** 2)))
    if missed < LITTLE * float(np.sqrt(np.mean(command**2))):
        return  # nothing is to be learned
    for said in findings(settings, command, effect):
        yield Finding(
            "range", channel, f"table of {channel}: {said}", "[correction] quantum",
            "set [correction] quantum to match, or leave it out: it is then proposed from the data",
            {"low": settings.low, "quantum": settings.quantum, "count": settings.count},
        )  # fmt: skip


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
    u, dt = (np.concatenate([getattr(one, name) for one in windows]) for name in ("u", "dt"))
    model, tuned = _live(view), work.editable(view.version)
    causes = (name for names in view.setup.causes.values() for name in names)
    silent = {}
    for name in dict.fromkeys((*tuned, *causes)):
        if reason := _disconnected(model, name, view.windows):
            silent[name] = reason
            yield Finding(
                "not_connected", name, reason, f"[tuning] editable or causes, {name}",
                "it stays as it is; take it out of [tuning] editable and causes, or look where the "
                "model uses it", {},
            )  # fmt: skip
    names = [name for name in tuned if name not in silent]
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
    yield from _undetermined(view, fit, u, dt)
    yield from _shared(view, fit)


def _live(view: View) -> Model:
    """The model at the version's own values: a term at its start values may do nothing."""
    return configured(view.model, parameters=view.model.parameters.with_values(view.version.p))


def _disconnected(model: Model, name: str, windows: tuple[Block, ...]) -> str:
    u, dt = (np.concatenate([getattr(one, of) for one in windows]) for of in ("u", "dt"))
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            connected(model, (name,), u, dt)
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


def _shared(view: View, fit: Fit) -> Iterator[Finding]:
    """Parameters that tell wear, of which another one that is tuned too has much the same effect:
    from fit to fit the two trade, and the indicator jumps."""
    with np.errstate(all="ignore"):
        alike = np.abs(fit.covariance / np.outer(fit.sigma, fit.sigma))
    for rule in view.setup.spec.indicator:
        if rule.parameter not in fit.names:
            continue
        j = fit.names.index(rule.parameter)
        others = [n for k, n in enumerate(fit.names) if k != j and alike[j, k] > SHARED]
        if others:
            yield Finding(
                "shared", rule.parameter,
                f"{rule.parameter} tells the wear of {rule.component or rule.name}, and "
                f"{', '.join(others)}, tuned with it, acts much alike: one hides in the other",
                f"[tuning] editable, [[indicator]] {rule.name}",
                f"leave {rule.parameter} alone of them in [tuning] editable",
                {"parameters": others},
            )  # fmt: skip


def _undetermined(view: View, fit: Fit, u: Inputs, dt: Vector) -> Iterator[Finding]:
    """One finding for parameters that cannot be told for the same reason."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name, verdict, reason in zip(fit.names, fit.verdict, fit.reasons, strict=True):
        if verdict != "identifiable":
            groups.setdefault((verdict, reason), []).append(name)
    model = _live(view)
    for (verdict, reason), names in groups.items():
        own = [name for name in names if name in model.parameters.names]  # not recordings' starts
        motion = advise(model, own, u, dt) if own else ()
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
