"""Why nothing better than the live version was found, as far as events tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from evertwin.fold import Event
from evertwin.outcome.open.on_trial import OpenTrial, shorter
from evertwin.rows.channels import recorded_as
from evertwin.setup.setup import Setup

CLEAR = 0.03
"""Share by which a deviation has to fall, or rise, to be called better, or worse."""
CHANGE = "change of "
"""Before an input: what depends on that comes late, or early."""
NO_MACHINE = ("not physical: ", "outside: ")
"""How a rejection begins of numbers that no machine has, whatever they explain."""
UNTUNED = "nothing could be tuned: "
"""The same, where there was no candidate at all."""


def nothing_better(
    setup: Setup, events: Sequence[Event], trial: OpenTrial | None, measured: int = 0
) -> str:
    """That a candidate is on trial, or what stands in the way of one; ``measured``: rows that
    measure an output."""
    if trial is not None:
        if not trial.segments:
            return "a candidate has gone on trial, of which no unseen row has told yet"
        if trial.gain > CLEAR:
            to_come = "" if trial.seconds is None else (
                f", decided in about {trial.seconds:.0f} s if it goes on so")  # fmt: skip
            return (
                f"a better version is on trial ({shorter(trial.reason)}): {100 * trial.gain:.0f} % "
                f"less deviation so far{to_come}"
            )
        so_far = "worse" if trial.gain < -CLEAR else "no better"
        return f"the candidate that is on trial is {so_far} so far"
    doubted = of_a_sensor(events)
    if doubted:
        return doubted
    verdicts = [e for e in events if e.kind in ("noise", "normal", "abnormal")]
    if verdicts and verdicts[-1].kind == "noise":
        return verdicts[-1].reason
    depends = _dependence(events)
    channel = depends.removeprefix(CHANGE)
    if channel in setup.model.inputs.names and not setup.spec.correction.terms:
        two = two_clocks(setup, events)
        return (
            f"no parameter of the model explains it: it depends on {depends}{two}. To let the twin "
            f'learn that, add [correction] channels = ["{channel}"], terms = ["lag", "table", '
            '"law"] to its file'
        )
    rejected = [e.reason for e in events if e.kind == "rejected"]
    if rejected and rejected[-1].startswith(UNTUNED):
        return rejected[-1]
    if rejected:
        tried = f"{len(rejected)} candidates were" if len(rejected) > 1 else "1 candidate was"
        why = f", the last {rejected[-1]}" if rejected[-1].startswith(NO_MACHINE) else ""
        return f"nothing better was found: {tried} tried{why}"
    if 0 < measured < setup.enough and not any(e.kind == "suspected" for e in events):
        return (
            f"nothing was looked for: {measured:,} rows are fewer than the {setup.enough:,} of "
            "[anomaly] window, on which a deviation is judged"
        )
    return "nothing better has been found yet"


def of_a_sensor(events: Sequence[Event]) -> str:
    """What was said last of a channel that is not what it was, or is said to be; else nothing."""
    found = list[Event]()
    for event in reversed(events):
        if event.kind == "promoted" or _clears(event):
            break
        if event.kind == "abnormal":
            found.append(event)
    if not found or "number" not in found[0].evidence:
        return ""
    named = dict.fromkeys(e.signal for e in reversed(found) if "number" in e.evidence)
    others = [signal for signal in named if signal and signal != found[0].signal]
    return found[0].reason + f"; before, {' and '.join(others)} was named" * bool(others)


def _clears(event: Event) -> bool:
    """Does it take back what was said of a channel?"""
    return event.kind == "normal" and "doubt" in event.evidence


def _dependence(events: Sequence[Event]) -> str:
    """What a deviation was found last to depend on, beside the model's parameters."""
    abnormal: list[Any] = [e.evidence.get("dependence") for e in events if e.kind == "abnormal"]
    return next((str(found["input"]) for found in reversed(abnormal) if found), "")


def two_clocks(setup: Setup, events: Sequence[Event]) -> str:
    """Where the change of an input explains a deviation, and outputs are of another source: that
    one of the two may be late; else nothing."""
    depends = _dependence(events)
    if not depends.startswith(CHANGE):
        return ""
    of = {name: source.name for source in setup.spec.source for name in source.channels}
    command = of.get(recorded_as(setup.spec, depends.removeprefix(CHANGE)))
    outputs = [of.get(recorded_as(setup.spec, name)) for name in setup.model.outputs.names]
    others = [name for name in dict.fromkeys(outputs) if name not in (None, command)]
    if command is None or not others:
        return ""
    return (
        f", as where the clocks of {command} and {others[0]} differ or one comes late: evertwin "
        "doctor measures by how much, and [[source]] offset takes it away"
    )
