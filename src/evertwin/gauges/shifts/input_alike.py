"""Would a meter of an input that is off make the rows look as the machine's new numbers do?

A current that is recorded 15 % too small makes every torque of a drive 15 % smaller: as if inertia
and friction had all become smaller by that. One number of an input, with the machine as it was, is
held against all numbers that were tuned. Where it explains as much, that is said beside them; the
machine is learned all the same, for of its own record nothing says otherwise.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np

from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import LEAST, Rows, unchanged
from evertwin.gauges.rows.sensor_change import since_change, unmeasured
from evertwin.gauges.shifts.off_by import left_with
from evertwin.ledger.caveats import MORE, SAME
from evertwin.rows.channels import measured
from evertwin.signals import Layout
from evertwin.signals.spoken import MANY, share
from evertwin.signals.units import compatible
from evertwin.types import Bools, Outputs

STEPS = 4
"""Steps towards what a meter is off by."""
SHARE = 0.1
"""What a share is tried with."""
LIKE = 1.1
"""So many times what tuning leaves a meter may leave."""
CLEARLY = 2.0
"""So many times what a meter leaves tuning has to leave for the meter to explain more."""
CHANCE = 2.0
"""Standard deviations by which the mean square of few rows may be smaller by chance."""
EXPLAINED = 0.2
"""Share of the squared deviation that it leaves at most."""


@unmeasured()
def alike_inputs(rows: Rows) -> str:
    """What meters of inputs would have to be off by for the rows to look the same; empty: none.

    Args:
        rows: of a machine that held, tuned. Of a static map a position or a speed beside its rate
            is no meter of its own.
    """
    setup, model = rows.setup, rows.setup.model
    if not rows.problem.windows:
        return ""
    beside = set[int]() if len(model.states) else _beside_their_rates(model.inputs)
    alone = [columns[0] for columns, _ in measured(setup.spec, model.inputs).values()
             if not columns[1:] and columns[0] not in beside]  # fmt: skip
    tried = [(k, scaled) for k in sorted(alone) for scaled in (True, False)]
    found = [one for k in tried for one in (_off(rows, *k),) if one is not None]
    if not found:
        return ""
    least = min(left for left, *_ in found)
    said = " or ".join(told for left, _, told in found if left <= LIKE * least)
    if min(tuned for _, tuned, _ in found) > CLEARLY * least:
        return f"; a meter of {said} {MORE}"
    return f"; a meter of {said} {SAME}"


def _beside_their_rates(inputs: Layout) -> set[int]:
    """Columns of places, speeds and the like whose rate is an input too, and of these."""
    pairs = permutations(range(len(inputs)), 2)
    return {k for pair in pairs if _is_rate(*(inputs.units[k] for k in pair)) for k in pair}


def _is_rate(of: str, unit: str) -> bool:
    return compatible(f"({of})/s", unit)


def _off(rows: Rows, k: int, scaled: bool) -> tuple[float, float, str] | None:
    """What is left of the rows where input ``k`` is off by one number, what tuning leaves of them,
    and that number in words."""
    step = SHARE if scaled else float(np.nanstd(rows.values[:, k]))
    if not step > 0.0:
        return None
    theirs, here = rows.tuned[rows.fitted :], _here(rows)
    left = first = unchanged(rows.pose(rows.problem.windows))
    by = 0.0
    for _ in range(STEPS):
        slope = (_left(rows, k, scaled, by + step) - left) / step
        more = float(rows.least(slope[:, :, None], left, here)[0])
        by, step = by + more, max(abs(more), 1e-3 * step)
        if not np.isfinite(by) or (scaled and by <= SHARE - 1.0):
            return None
        left = _left(rows, k, scaled, by)
    known = np.isfinite(left) & np.isfinite(theirs) & np.isfinite(first) & here[:, None]
    ours, tuned, off = (rows.total(one, known) for one in (left, theirs, first))
    count = int(np.count_nonzero(known.any(axis=1)))
    like = max(LIKE, 1.0 + CHANCE * math.sqrt(2.0 / max(count, 1)))  # several numbers fit a few
    if count < LEAST or ours > min(like * tuned, EXPLAINED * off):
        return None
    channel = rows.setup.model.inputs.channels[k]
    size = in_words.difference(rows.setup, channel, by)
    if scaled:
        size = f"{100 * by:+.3g} %" if abs(by) < MANY else share(by)
        size += f", or {channel.name} that acts by {100 / (1.0 + by):.3g} % of what is recorded,"
    return ours, tuned, f"{channel.name} that is off by {size}"


def _left(rows: Rows, k: int, scaled: bool, by: float) -> Outputs:
    """Residual of the version as it is, the input without what it is off by, (n, ny)."""
    all_by = np.where(_here(rows), by, 0.0)
    return left_with(rows.setup, rows.pose, rows.problem.windows, (k, scaled), all_by)


def _here(rows: Rows) -> Bools:
    """Tuned rows of the machine as it is now; where no change was found, since the deviation."""
    first = 0 if rows.fitted else since_change(rows.before[:, rows.setup.watched])
    return np.asarray(np.arange(rows.count - rows.fitted) >= first)
