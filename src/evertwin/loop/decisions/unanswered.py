"""Measured inputs that no longer answer: what seems to act on the machine then is none of it.

An output that goes by how its machine moves varies as if it moved, by what nothing else explains,
while the position or speed by which that is known has not changed in the least: its sensor no
longer answers, or the machine is held. A sensor that scatters does not change where all of it is
noise; one that goes anywhere, however slowly, answers. At rest outputs hardly vary but by what else
moves, so a machine may stand for as long as it likes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from evertwin.ledger.versions import Versions
from evertwin.loop.decisions.decision import Decision
from evertwin.loop.decisions.disturbances import forget
from evertwin.models.batch import mapped
from evertwin.rows.alignment import reach
from evertwin.rows.channels import measured
from evertwin.rows.ring import Rows, called, kept
from evertwin.setup.setup import Setup
from evertwin.signals import wrap
from evertwin.types import Bools, Inputs, Outputs, Vector

LEAST = 30
"""Rows that tell how much an output usually varies."""
DRIVEN = 0.15
"""How much an output varies from which on its machine is driven, at rest in between or not [of when
it moves]."""
NOISE = 3.0
"""The same [of what differs from row to row; of when it stood before]."""
MUCH, LONGER = 0.5, 2.0
"""The same [of when it moves], and rows for which it stands [of the most before], where a channel
scatters."""
PIECE, FAR = 10, 6.0
"""Rows of which the median tells where a channel is, and how far from where it is at most all are
that only scatter [of what a median scatters by]."""
APART = 3
"""Rows from one to another by which is told how much a channel scatters: neighbours may be of one
reading."""
SCATTERS = 2
"""A channel is known not to answer, though it does not stay what it is."""


def unanswered(decision: Decision, setup: Setup, versions: Versions) -> bool:
    """Tells of inputs that no longer answer. True: one does not, so nothing is asked for."""
    state = decision.state
    still, asked = setup.still.beat(state.still)
    decision.state = state._replace(still=still)
    for k, columns in enumerate(setup.still.channels):
        if still.said[k] == SCATTERS and not _stands(setup, state.ring, columns):
            still.said[k] = -1 - state.row
    ends = still.said < 0
    sound = int((-1 - still.said[ends]).max(initial=0)) + reach(setup.spec)
    if ends.any() and state.row >= sound:
        still.said[ends] = 0
        if not still.said.any():
            _left_out(decision, setup, sound)
            return True
    if state.agenda.commissioned:
        for k, count in asked:
            _ask(decision, setup, versions, (k, count, DRIVEN))
        for k, columns in enumerate(setup.still.channels):
            count = _stands(setup, state.ring, columns)
            if not still.said[k] and count >= setup.still.least:
                _ask(decision, setup, versions, (k, count, MUCH))
    if not still.said.any():
        return False
    _left_out(decision, setup, state.row)
    return True


def _left_out(decision: Decision, setup: Setup, until: int) -> None:
    """Rows since the beat before are of a channel that does not answer, up to ``until``: they are
    in no window, and what was asked of them, or judged by them, is forgotten."""
    state = decision.state
    setup.ring.leave_out(state.ring, min(state.agenda.since, until), until - 1)
    forget(decision)
    since = max(state.agenda.since, until)
    decision.remember(open=0, again=0, told=False, since=since)


def _ask(
    decision: Decision, setup: Setup, versions: Versions, channel: tuple[int, int, float]
) -> None:
    """Tells of a channel, its number, the rows since which it stands, and how much outputs have to
    vary."""
    k, count, least = channel
    state, columns = decision.state, setup.still.channels[k]
    version = versions[state.live.version]
    predict = partial(mapped, versions.model(version.number), p=version.p)
    outputs = _driven(setup, state.ring, (columns, count, least), predict)
    if not outputs:
        return
    state.still.said[k] = SCATTERS if least == MUCH else 1
    first = max(state.row - count - 1 - reach(setup.spec), 0)
    setup.ring.leave_out(state.ring, first, state.row - 1)
    decision.remember(since=max(state.agenda.since, first))
    channels = measured(setup.spec, setup.model.inputs).items()
    name = next(name for name, (own, _) in channels if tuple(own) == columns)
    said = (
        f"{name} has {'not moved' if least == MUCH else 'not changed'} since "
        f"{called(state.row - count - 1)}, while "
        f"{' and '.join(outputs)} varies as when the machine moves: its sensor no longer "
        "answers, or the machine is held; nothing is learned from it"
    )
    decision.say("abnormal", name, said, {"number": 0.0, "since": state.row - count - 1})


def _stands(setup: Setup, rows: Rows, columns: tuple[int, ...]) -> int:
    """Newest rows in which nothing moves that is judged by a channel, where these are far more than
    ever before; else 0."""
    if rows.end <= rows.first:
        return 0
    judged = np.isin(setup.judged_by[0], columns) & ~setup.judged_by[1]
    newest = rows.u[(rows.end - 1) % len(rows.t)][None]
    if setup.moving(newest)[:, judged].any():
        return 0
    moves = np.flatnonzero(setup.moving(rows.u[kept(rows, rows.first)])[:, judged].any(axis=1))
    if not len(moves):
        return 0
    count = len(kept(rows, rows.first)) - 1 - int(moves[-1])
    return count if count > LONGER * np.diff(moves, prepend=-1).max() else 0


def _driven(
    setup: Setup, rows: Rows, asked: tuple[tuple[int, ...], int, float],
    predict: Callable[..., Outputs],
) -> list[str]:  # fmt: skip
    """Outputs that vary on the newest rows as they do when the machine moves, but for what is
    predicted of them.

    Args:
        setup: of the twin.
        rows: that are kept.
        asked: columns of the channel, the number of these rows, and the share of how they vary when
            the machine moves.
        predict: outputs of inputs ``u`` at intervals ``dt``.
    """
    (columns, count, least), places = asked, kept(rows, rows.first)
    now, u, y = np.arange(len(places)) >= len(places) - count, rows.u[places], rows.y[places]
    moving, by, found = setup.moving(u), setup.judged_by[0], list[str]()
    if not _only_scatters(u[now, columns[0]]) or _as_slow(setup, u[now], columns):
        return []
    at_rest = u.copy()
    if least == MUCH:  # friction at rest is not what the sign of a speed says that scatters
        at_rest[:, by] = np.where(moving, u[:, by], 0.0)
    off = y - predict(u=at_rest, dt=rows.dt[places])
    same = (u[1:, columns] == u[:-1, columns]).all(axis=1)
    stood = ~now & np.concatenate([[False], same])
    for k, name in enumerate(setup.model.outputs.names):
        if by[k] not in columns or setup.judged_by[1][k]:
            continue
        here, usual = _spread(off[now, k]), _spread(y[~now & moving[:, k], k])
        noise, rest = _spread(np.diff(off[now, k])) / np.sqrt(2.0), _spread(off[stood, k])
        if least == MUCH:
            rest = _spread(off[~now & _stood(~moving[:, k], setup.still.least), k])
        if here > max(least * usual, NOISE * noise) and not here <= NOISE * rest:
            found.append(name)
    return found


def _only_scatters(values: Vector) -> bool:
    """Is a channel, (rows,), where it was on all rows, but for its noise and one step?"""
    known = values[np.isfinite(values)]
    changes = np.abs(np.diff(known))
    if not changes.any():
        return True
    noise = _spread(known[APART:] - known[:-APART]) / (1.349 * np.sqrt(2.0))
    places = _places(known)
    limit = FAR * 1.25 * noise / np.sqrt(PIECE) + changes[changes > 0.0].min()
    return bool(np.abs(places - np.median(places)).max(initial=0.0) <= limit)


def _as_slow(setup: Setup, u: Inputs, columns: tuple[int, ...]) -> bool:
    """Is there a position beside the speed of a channel by which the machine, on rows ``u``, went
    nowhere faster than what stands may go?"""
    judged = np.isin(setup.judged_by[0], columns) & ~setup.judged_by[1]
    for place, speed, angle in setup.kinematics.columns:
        if speed not in columns or place in columns:
            continue
        went = wrap(np.diff(_places(u[:, place]))[:, None], np.array([bool(angle)]))
        there = np.repeat(u[:1], len(went), axis=0)
        there[:, speed] = went[:, 0] * setup.kinematics.rate / PIECE
        return not setup.moving(there)[:, judged].any()
    return False


def _places(values: Vector) -> np.ndarray:
    """Medians of a channel, (rows,), piece by piece."""
    count = len(values) // PIECE
    return np.asarray(np.median(values[: count * PIECE].reshape(count, PIECE), axis=1))


def _stood(still: Bools, rows: int) -> Bools:
    """Rows of which so many before are still, too: a motion that turns is no rest."""
    place = np.arange(len(still))
    return np.asarray(place - np.maximum.accumulate(np.where(still, -1, place)) >= rows)


def _spread(values: Vector) -> float:
    """Between the quartiles: a push that is brief does not count. NaN: too few rows."""
    known = values[np.isfinite(values)]
    return float(np.subtract(*np.quantile(known, (0.75, 0.25)))) if len(known) >= LEAST else np.nan
