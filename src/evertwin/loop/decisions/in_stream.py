"""The live version's parameters in the stream: predict a beat ahead, then learn.

What wears, warms or settles is followed from beat to beat (``[tuning] method = "recursive"``), and
each joint or channel by itself; what else deviates is still tuned, tried and promoted as ever, from
the values as they are now. A pinned version stays as it is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.decision import Decision
from evertwin.models import LinearModel
from evertwin.models.form import Version
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TwinState
from evertwin.tuning import Following

OFTEN = 3_600_000_000_000
"""Time within a recording after which it is said again what is followed [ns]."""
TOLD = 0.5
"""Standard deviation, by that of the prior, up to which rows tell a value."""
MOST = 3
"""Values that are named in a sentence."""


def following(setup: Setup, versions: Versions, number: int) -> Following | None:
    """The stage of a version; None where it has nothing to follow."""
    version, model, rule = versions[number], versions.model(number), setup.spec.tuning
    if not setup.followed or not isinstance(model, LinearModel):
        return None
    own = versions.values(number)
    # what a ladder has not taken is not there
    names = tuple(n for n in setup.followed if own.get(n) or (n in own and not rule.ladder))
    if not names:
        return None
    return Following(model, names, version.p, rule.memory, rule.spread, rule.caution, setup.gates)


def tell_followed(decision: Decision, stage: Following, *, task_end: bool) -> None:
    """Says what is followed, at the end of a recording and now and then: its values, intervals and
    what they leave of the version's deviation, for a person and for the parameter history."""
    state, names = decision.state, stage.followed(decision.state.stream)
    if not names or not (task_end or state.elapsed >= state.agenda.followed + OFTEN):
        return
    parameters, number = stage.model.parameters, state.live.version
    known = dict(zip(stage.names, zip(stage.sigma(state.stream), stage.prior, strict=True),
                     strict=True))  # fmt: skip
    told, moved = dict[str, Any](), list[tuple[float, str]]()
    for name in names:
        place = parameters.index(name)
        value, before = float(state.stream.p[place]), float(stage.values[place])
        sigma, prior = (float(size) for size in known[name])
        half, unit = 1.96 * sigma, parameters[name].unit
        told[name] = {
            "value": value, "unit": unit, "interval95": [value - half, value + half],
            "verdict": "identifiable" if sigma <= TOLD * prior else "weak",
        }  # fmt: skip
        moved.append((abs(value - before) / prior, f"{name} {value:.3g} {unit} ({before:.3g})"))
    left, outputs = stage.left(state.stream), stage.model.outputs.names
    best = int(np.argmin(left))
    most = ", ".join(said for _, said in sorted(moved, reverse=True)[:MOST])
    said = (
        f"version {number} follows the machine: {outputs[best]} is off by {100 * left[best]:.0f} % "
        f"of what it would be; most of all {most}"
    )
    evidence = {
        "version": number, "fit": {"parameters": told}, "time": state.time, "task": state.task,
        "elapsed": state.elapsed, "left": dict(zip(outputs, left.tolist(), strict=True)),
    }  # fmt: skip
    decision.say("followed", outputs[best], said, evidence)
    decision.remember(followed=state.elapsed)


def as_is(versions: Versions, state: TwinState) -> Version:
    """The live version with the values that predict now."""
    version = versions[state.live.version]
    values = version.values if state.stream == () else tuple(state.live.track.p.tolist())
    return replace(version, values=values)
