"""A sensor of several that make one output, in the place of one beside the machine.

Sensors that measure the same answer to a command alike. Where one of them does not, and one that an
input is measured by does, these two have changed roles: no fit tells, for a model tunes itself to
whatever it is given. Answers are compared as the correlation of what a channel changes by over a
horizon, or a part of it, with what the command was on average meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evertwin.doctor.examination import Samples, View
from evertwin.doctor.finding import Finding
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.rows.channels import averaged, is_held, measured_as
from evertwin.signals.units import compatible
from evertwin.types import Vector

ANSWERS = 0.5
"""Least correlation with a command of what answers to it."""
LESS = 0.5
"""Part of the others' correlation that the odd one's reaches at most."""
PARTS = (1, 4, 16)
"""Parts of a horizon over which a channel may answer: what is quick has done so long before."""
LEAST = 10
"""Horizons that a recording has to hold."""


def look_roles(view: View) -> Iterator[Finding]:
    """The sensor of an average that does not answer to a command as the others do, where one that
    an input is measured by does."""
    spec, model = view.setup.spec, view.model
    dynamic = not view.setup.static
    units = {name: one.unit for source in spec.source for name, one in source.channels.items()}
    inputs = {name: measured_as(spec, name) for name in model.inputs.names}
    beside = [inputs[n] for n in inputs if not is_held(spec, n, dynamic)]
    commands = [inputs[n] for n in inputs if is_held(spec, n, dynamic)]
    for output in model.outputs.names:
        members = averaged(spec, output)
        rivals = [n for n in beside if n in units and n not in members]
        alike = [n for n in rivals if all(compatible(units[n], units.get(m, "")) for m in members)]
        for samples in view.recorded:
            if not {*members, *alike, *commands} <= set(samples.names) or not (members and alike):
                continue
            for command in commands:
                yield from _odd(view, samples, output, command, members, alike)


def _odd(
    view: View, samples: Samples, output: str, command: str, members: tuple[str, ...],
    rivals: list[str],
) -> Iterator[Finding]:  # fmt: skip
    rows = max(round(view.horizon / samples.step), 1)
    if len(samples.v) < LEAST * rows:
        return
    column = {name: samples.v[:, k] for k, name in enumerate(samples.names)}
    spans = {max(rows // part, 1) for part in PARTS}
    answer = {
        name: max(_answer(column[name], column[command], span) for span in spans)
        for name in (*members, *rivals)
    }
    odd = min(members, key=lambda n: answer[n])
    others = [answer[n] for n in members if n != odd]
    rival = max(rivals, key=lambda n: answer[n])
    if not min(*others, answer[rival], 1.0) >= max(ANSWERS, answer[odd] / LESS):
        return
    shown = ", ".join(f"{name} {answer[name]:.2f}" for name in answer)
    yield Finding(
        "exchanged", odd,
        f"{odd} and {rival} look exchanged: {rival} answers to {command} as what {output} is the "
        f"mean of, and {odd} does not (correlation {shown})", "[source.channels]",
        f"exchange the columns of {odd} and {rival}, if that is confirmed",
        {"hypotheses": [[odd, rival]], "answers": answer},
    )  # fmt: skip


@unmeasured()
def _answer(values: Vector, command: Vector, rows: int) -> float:
    """How closely what a channel changes by over so many rows goes with the command meanwhile."""
    total = np.concatenate([[0.0], np.cumsum(command)])
    acting = (total[rows:-1] - total[: -rows - 1]) / rows
    change = values[rows:] - values[:-rows]
    known = np.isfinite(change) & np.isfinite(acting)
    found = abs(float(np.corrcoef(change[known], acting[known])[0, 1])) if known.any() else 0.0
    return found if np.isfinite(found) else 0.0
