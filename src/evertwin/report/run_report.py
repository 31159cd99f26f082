"""The report of a run: decisions, evidence, parameters, pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from evertwin.fold import Event, plain
from evertwin.models import Model
from evertwin.models.form import Version
from evertwin.outcome.result import OutputFigures, RunResult
from evertwin.report.charts import inline
from evertwin.report.html import write_page
from evertwin.report.run_pictures import (
    draw_deviation,
    draw_improvement,
    draw_rounds,
    draw_run,
    draw_table,
)
from evertwin.setup.setup import Setup
from evertwin.signals.spoken import both
from evertwin.trial.odds import odds
from evertwin.types import Outputs, ParameterVector

MOST = 8
"""Outputs that are drawn."""
ROUNDS = 8
"""Versions or rounds in one picture at most: the first ones and the last."""
WORDS = {
    "segments": "segments of unseen data",
    "deviation_live": "mean deviation, live version",
    "deviation_other": "mean deviation, challenger",
    "rms_live": "rms deviation, live version",
    "rms_other": "rms deviation, challenger",
    "gain": "relative gain",
    "e_value": "e-value for the challenger",
    "e_value_against": "e-value against it",
    "missed": "demands not met",
    "version": "version",
    "hash": "hash of the version",
}
"""Evidence of a trial, in words."""
Picture = tuple[str, str, Markup]
"""Title, caption, picture."""
NARROW = 4.6
"""Width of the first picture on a telephone [in]."""


def write_report(result: RunResult, setup: Setup, path: Path) -> None:
    """Writes the report of a run.

    Raises:
        UsageError: the file cannot be written.
    """
    content: Any = result.to_dict()
    write_page("report.html", path, {
        "run": content,
        "name": result.name,
        "relative": setup.relative,
        "updating": _updating(result, setup),
        "first": first_picture(result), "narrow": first_picture(result, NARROW),
        "lead": "" if setup.static or not math.isfinite(setup.horizon) else f"{setup.horizon:g} s",
        "better": result.champion.number > 0,
        "checks": _checks(result, setup), "gains": _gains(result),
        "pictures": list(_pictures(result, setup)),
        "trial": result.trial,
        "trials": [_trial(e) for e in result.of_kind("promoted", "rolled_back", "rejected")],
        "tuned": {k: v for k, v in content["parameters"].items() if v["verdict"] != "not tuned"},
        "kept": {k: v for k, v in content["parameters"].items() if v["verdict"] == "not tuned"},
        "outputs": result.model.outputs.names,
    })  # fmt: skip


def _trial(event: Event) -> dict[str, Any]:
    evidence: Any = plain(event.evidence)
    known = [(WORDS[key], evidence[key]) for key in WORDS if key in evidence]
    return {"row": event.row, "kind": event.kind, "reason": event.reason, "evidence": known}


def _updating(result: RunResult, setup: Setup) -> bool:
    return setup.spec.arbiter.use == "tolerance" or any(result.position_updates)


def first_picture(result: RunResult, wide: float = 9.0) -> Markup | None:
    """The picture that opens the report; ``wide``: in inches."""
    figure = draw_improvement(result, result.asked, 300 if wide > NARROW else 150, wide)
    return None if figure is None else inline(figure, "measured, before, now; what is off")


def _gains(result: RunResult) -> list[tuple[str, str]]:
    """Of each output what became of its deviation, in a person's units."""
    told = []
    for name, one in result.outputs.items():
        if math.isnan(one.rms_after):
            told.append((name, "no row to tell it by"))
            continue
        first, last = both(one.before, one.after, one.unit, one.recorded)
        less = 1.0 - one.after / one.before if one.before > 0.0 else 0.0
        change = f"{abs(less):.0%} {'less' if less > 0.0 else 'more'}"
        told.append((name, f"off by {last}, as before" if one.after == one.before
                     else f"{change}: {first} → {last}"))  # fmt: skip
    return told


def _checks(result: RunResult, setup: Setup) -> list[tuple[str, str]]:
    """How far the live version is to be trusted: (yes, no, open) and a line each."""
    rule, live = setup.spec.trial, result.champion.number
    went = [e for e in result.of_kind("promoted") if e.evidence.get("version") == live]
    checks = [_asked(setup, name, one) for name, one in result.outputs.items()]
    if live == 0:
        checks.append(("open", "Nothing went live: the twin runs as configured."))
    elif not went or "segments" not in went[-1].evidence:
        checks.append(("no", "It did not have to prove itself: it was live before, or by hand."))
    else:
        found: Any = went[-1].evidence
        checks += [
            ("yes", f"Tried on {found['segments']} stretches that neither version had seen."),
            ("yes", f"{found['gain']:.0%} less deviation there; at least {rule.margin:.0%} asked."),
            ("yes", f"Odds of {odds(found['e_value'])} that this is no chance; "
                    f"{odds(1 / rule.alpha)} asked."),
        ]  # fmt: skip
    known: Any = result.to_dict()["parameters"]
    weak = [name for name, one in known.items() if one["verdict"] in ("weak", "not")]
    if weak:
        checks.append(("no", f"Weakly known, so not to be relied on alone: {', '.join(weak)}."))
    if result.trial is not None:
        checks.append(("open", f"Not decided yet. {result.trial}"))
    return checks


def _asked(setup: Setup, name: str, one: OutputFigures) -> tuple[str, str]:
    """Is an output within what is asked?"""
    value = one.relative_rms_moving_after if setup.relative else one.rms_after
    value = one.relative_rms_after if setup.relative and math.isnan(value) else value
    limit, k = setup.requirement, setup.model.outputs.index(name)
    if math.isnan(value) or not math.isfinite(limit) or not setup.watched[k]:
        why = "no row tells it" if math.isnan(value) else "no requirement is set"
        return "open", f"{name}: cannot be told, {why}."
    shown, asked = setup.shown(k, value), setup.shown(k, limit)
    if value <= limit:
        return "yes", f"{name}: off by {shown}, within the {asked} that is asked."
    return "no", f"{name}: off by {shown}, more than the {asked} that is asked."


def _pictures(result: RunResult, setup: Setup) -> Iterator[Picture]:
    """(title, caption, image) of each picture."""
    names = result.model.outputs.names[:MOST]
    for event in result.of_kind("corrected"):
        yield from _table(result, event)
    if _updating(result, setup):
        yield from _updates(result, setup)
    if setup.static:
        yield from _rounds(result)
    caption = (
        "Above: measured and predicted, position updates marked. Below: the residual with its 95 % "
        "band. Dashed: a change of the live version."
    )
    for name in names:
        yield f"Run: {name}", caption, inline(draw_run(result, name), f"{name} over the run")


def _table(result: RunResult, event: Event) -> Iterator[Picture]:
    """The translation table that a correction learned, although a law may have replaced it."""
    table: Any = event.evidence.get("table")
    if not table:
        return
    inputs = result.model.inputs
    unit = inputs.units[inputs.index(table["channel"])]
    caption = f"Learned at row {event.row}, level by level. What was made of it: {event.reason}."
    yield "Translation table", caption, inline(draw_table(table, unit), "done over commanded")


def _updates(result: RunResult, setup: Setup) -> Iterator[Picture]:
    """Deviation of the newest samples by the first and by the last champion."""
    outputs = result.model.outputs
    group = outputs.channels[0].group
    rule = setup.track(result.model).arbiter.rule_of(group)
    for channel in outputs:
        if channel.group != group:
            continue
        limit = rule.tolerance_angle if channel.kind == "angle" else rule.tolerance
        for before in (True, False):
            when = "before" if before else "after"
            title = f"Deviation of {channel.name} {when} self-improvement"
            caption = (
                f"{'First model' if before else 'Live version'}, newest 100 measured samples. A "
                "position update happens when any output of the group exceeds its tolerance."
            )
            figure = draw_deviation(result, channel.name, before, limit)
            yield title, caption, inline(figure, title)


def _rounds(result: RunResult) -> Iterator[Picture]:
    """The last task as every version, and every round of tuning, predicts it."""
    trace = result.trace
    last = trace["task"] == trace["task"][-1]
    u = np.ascontiguousarray(trace["input"][last])
    t = (trace["t"][last] - trace["t"][last][0]) * 1e-9
    names, measured = result.model.outputs.names, trace["measured"][last]
    versions = [
        (f"version {v.number}", _predicted(result.model_of(v), v.p, u)) for v in result.versions
    ]
    figure = draw_rounds(measured, _few(versions), names, t)
    caption = "The last task, measured and as the versions predict it."
    what = "Torque per axis" if "Nm" in result.model.outputs.units else "Each output"
    yield f"{what} and version", caption, inline(figure, caption)
    if not result.rounds:
        return
    rounds = [
        (f"round {k}", _predicted(*_of_round(result, item), u))
        for k, item in enumerate(result.rounds)
    ]
    figure = draw_rounds(measured, _few(rounds), names, t)
    caption = "The last task, measured and as each round of tuning predicts it."
    yield f"{what} and round", caption, inline(figure, caption)


def _few(items: Sequence[tuple[str, Outputs]]) -> list[tuple[str, Outputs]]:
    return [*items[: ROUNDS - 1], items[-1]] if len(items) > ROUNDS else list(items)


def _of_round(result: RunResult, item: Mapping[str, Any]) -> tuple[Model, ParameterVector]:
    version: Version = result.versions[item["version"]]
    model = result.model_of(version)
    parameters = model.parameters.with_values(version.p).with_values(item["values"])
    return model, parameters.values


def _predicted(model: Model, p: ParameterVector, u: np.ndarray) -> Outputs:
    _, y = model.simulate(model.initial(p), u, np.zeros(len(u)), p)
    return y
