"""What became of a channel, asked of rows that a version was tuned on."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import DataError, ModelError
from evertwin.gauges.changes.change import suddenly
from evertwin.gauges.changes.unseen_inputs import elsewhere
from evertwin.gauges.delays.clock_unit import of_the_clock
from evertwin.gauges.delays.late_outputs import late_outputs
from evertwin.gauges.delays.late_scans import late_scans, said_late
from evertwin.gauges.frozen.stuck import stuck
from evertwin.gauges.gauge import misgauged, reread
from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.sensor_change import SensorChange
from evertwin.gauges.shifts.input_alike import alike_inputs
from evertwin.gauges.shifts.off_in_all import in_all
from evertwin.gauges.shifts.offset import leapt
from evertwin.gauges.shifts.output_shift import shifted_output
from evertwin.gauges.units.kinematic import apart
from evertwin.gauges.units.misread import misread
from evertwin.gauges.units.turned import of_an_angle
from evertwin.ledger.caveats import SAME, SENSOR, caveats_of
from evertwin.refit.answer_events import event
from evertwin.refit.tuner.tuner import ENOUGH, Tuner
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.tuning import Fit, Problem

FEW = 4
"""Numbers up to which it is asked whether they are a constant alone."""
CONSTANT = 1e-6
"""Share by which what a constant makes differs from row to row."""


def caveats(task: Task, content: dict[str, Any]) -> None:
    """What would look the same as the live version would look the same as one that goes on from it,
    until another one goes live, or a person names the cause. Writes the reason of a candidate."""
    found = content.get("candidate")
    if found is None or "brief" in found or task.cause:
        return
    old, new = (caveats_of(reason) for reason in (task.version.reason, found["reason"]))
    kept = [said for channel, said in old.items() if channel not in new]
    found["reason"] = "; ".join([found["reason"], *kept])


def of_late_scans(tuner: Tuner, task: Task, content: dict[str, Any]) -> None:
    """Tells, beside the first candidate of a twin, that all of a pose by scans comes late."""
    version, setup = task.version, tuner.setup
    if version.number or task.rival is not None or not content.get("candidate"):
        return
    model = tuner.versions.model_of(version.form)
    if both := late_scans(setup, model, version.p, task.windows):
        evidence = {"heading": both[0]._asdict(), "way": both[1]._asdict()}
        content["events"].append(event("pose_late", "", said_late(setup, both), evidence))


def of_what_is_read(*rows: Any) -> SensorChange | None:
    """A reading, an angle or a unit of time that explains the ``rows`` of a machine that never
    held, as no tuning does; the arguments are those of `of_the_clock`."""
    return misread(*rows) or of_an_angle(*rows) or of_the_clock(*rows)


def of_a_bias(setup: Setup, problem: Problem, fit: Fit) -> str:
    """What a sensor would have to be off by, where all that was tuned of an output is a constant
    on it: of a few numbers, as a caveat."""
    if len(fit.names) > FEW:
        return ""
    effect = problem.jacobian(fit.values) * (fit.values - fit.start)
    for k, channel in enumerate(problem.model.outputs.channels):
        seen = effect[problem.rows.used[:, k], k]
        acting = seen[:, (seen != 0.0).any(axis=0)]
        by = acting.sum(axis=1)
        if len(by) and by.any() and np.ptp(acting, axis=0).max() <= CONSTANT * np.abs(by).max():
            said = in_words.difference(setup, channel, float(by[-1]))
            return f"; {SENSOR}{channel.name} that is off by {said} {SAME}"
    return ""


class Asked(NamedTuple):
    """What was found.

    >>> Asked().alike
    ''
    """

    change: SensorChange | None = None
    alike: str = ""
    """What a sensor would have to be for the rows to look the same."""


def of_a_channel(
    tuner: Tuner, task: Task, tuned: tuple[Problem, Fit], names: tuple[str, ...], *, told: bool
) -> Asked:
    """What became of a channel; of rows of a machine that held which are not ``told`` to say much,
    whether an input stays where it is, or what an output is off by explains a deviation."""
    if not task.commissioned:
        return Asked(_reread(tuner, task, names))
    if told and (late := late_outputs(*tuned)):
        return Asked(late)
    rows = tuner.rows(task, *tuned)
    if other := apart(rows):
        return Asked(other)
    still = stuck(rows, reached=tuner.holds(tuned[0], tuned[1].values))
    found = misgauged(rows, still) if told else still
    if found or not (told or task.waits):
        return Asked(found)
    # a step and its size, before what goes in lines
    if not told and (found := elsewhere(rows) or leapt(rows)):
        return Asked(found)
    change, alike = shifted_output(rows)  # of what no number of the machine explains, too
    if alike and task.untold is not None:
        pose = partial(tuner.problem, task.untold, names=tuner.editable(task.untold))
        whole = replace(rows, pose=pose, given=rows.sizes)
        alike = in_all(whole, alike, task.version.reason)
    if change or (alike and rows.setup.static):  # of a map one that would look the same is enough
        return Asked(change, alike)
    return Asked(change, alike + alike_inputs(rows))


def _reread(tuner: Tuner, task: Task, names: tuple[str, ...]) -> SensorChange | None:
    """The reading of a channel by which a twin that never held is suddenly off by far more."""
    pose = partial(tuner.problem, task.version, names=names)
    new = suddenly(task.windows, pose, common=False)
    if sum(len(block.t) for block in new) < ENOUGH * len(names):
        return None
    try:
        problem, fit, _ = tuner.tune(pose(new))
    except (DataError, ModelError):
        return None
    return reread(tuner.rows(task, problem, fit))
