"""Measured inputs that no longer answer: what seems to act on the machine then is none of it.

An output that goes by how its machine moves varies as if it moved, by what nothing else explains,
while the position or speed by which that is known has not changed in the least: its sensor no
longer answers, or the machine is held. At rest outputs hardly vary but by what else moves, so a
machine may stand for as long as it likes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from evertwin.ledger.versions import Versions
from evertwin.loop.decision import Decision
from evertwin.loop.disturbances import forget
from evertwin.models.batch import mapped
from evertwin.rows.channels import measured
from evertwin.rows.ring import Rows, called
from evertwin.setup.setup import Setup
from evertwin.types import Outputs, Vector

LEAST = 30
"""Rows that tell how much an output usually varies."""
DRIVEN = 0.15
"""How much an output varies from which on its machine is driven, at rest in between or not [of when
it moves]."""
NOISE = 3.0
"""The same [of what differs from row to row; of when it stood before]."""


def unanswered(decision: Decision, setup: Setup, versions: Versions) -> bool:
    """Tells of inputs that no longer answer. True: one does not, so nothing is asked for."""
    state = decision.state
    still, asked = setup.still.beat(state.still)
    decision.state = state._replace(still=still)
    agenda = state.agenda
    for k, count in asked:
        columns = setup.still.channels[k]
        version = versions[state.live.version]
        predict = partial(mapped, versions.model(version.number), p=version.p)
        outputs = _driven(setup, state.ring, columns, count, predict) if agenda.commissioned else []
        if not outputs:
            continue
        still.said[k] = 1
        first = max(state.row - count - 1, state.ring.end - len(state.ring.t), 0)
        setup.ring.leave_out(state.ring, first, state.row - 1)
        forget(decision)
        channels = measured(setup.spec, setup.model.inputs).items()
        name = next(name for name, (own, _) in channels if tuple(own) == columns)
        said = (
            f"{name} has not changed since {called(state.row - count - 1)}, while "
            f"{' and '.join(outputs)} varies as when the machine moves: its sensor no longer "
            "answers, or the machine is held; nothing is learned from it"
        )
        decision.say("abnormal", name, said, {"number": 0.0, "since": state.row - count - 1})
    if not still.said.any():
        return False
    decision.remember(open=0, since=state.row)
    return True


def _driven(
    setup: Setup, rows: Rows, columns: tuple[int, ...], count: int, predict: Callable[..., Outputs]
) -> list[str]:
    """Outputs that vary on the newest ``count`` rows as they do when the machine moves, but for
    what is predicted of them."""
    kept = np.arange(max(rows.first, rows.end - len(rows.t)), rows.end) % len(rows.t)
    now, u, y = np.arange(len(kept)) >= len(kept) - count, rows.u[kept], rows.y[kept]
    off, moving, found = y - predict(u=u, dt=rows.dt[kept]), setup.moving(u), list[str]()
    same = (u[1:, columns] == u[:-1, columns]).all(axis=1)
    stood = ~now & np.concatenate([[False], same])
    for k, name in enumerate(setup.model.outputs.names):
        if setup.judged_by[0][k] not in columns or setup.judged_by[1][k]:
            continue
        here, usual = _spread(off[now, k]), _spread(y[~now & moving[:, k], k])
        noise, rest = _spread(np.diff(off[now, k])) / np.sqrt(2.0), _spread(off[stood, k])
        if here > max(DRIVEN * usual, NOISE * noise) and not here <= NOISE * rest:
            found.append(name)
    return found


def _spread(values: Vector) -> float:
    """Between the quartiles: a push that is brief does not count. NaN: too few rows."""
    known = values[np.isfinite(values)]
    return float(np.subtract(*np.quantile(known, (0.75, 0.25)))) if len(known) >= LEAST else np.nan
