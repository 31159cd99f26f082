"""Did an arm's torques come through a first-order low pass that its motion did not?

A controller smooths what it reports of a motor's current more than of its angle. All torques then
lag behind the motion by one time constant, and friction and bodies would be tuned to that. So each
constant is tried: the motion that lags by it too explains the torques best, each of a joint that
moves, by what the description predicts, friction and a rotor. How many Nm a current is matters not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy

from evertwin.models import Model
from evertwin.models.batch import mapped
from evertwin.signals import Channel
from evertwin.signals.fir import Symmetric
from evertwin.signals.units import to_si
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import Match, Proposal
from evertwin.types import Bool, Float64, Outputs, Vector

LONGEST, STEPS = 0.1, 20
"""Longest time constant that is tried [s], and how many, from a quarter of a row on."""
NONE = 1e-3
"""Part of a row that is as good as no lag."""
ROWS, LEAST = 2000, 200
"""Rows, spread over the recording, that it is told by; and of one joint at least."""
SMOOTHED = 5.0
"""Cut-off [Hz] of both sides: where an acceleration is noisy, any low pass would pay."""
LEFT, WORST = 0.95, 1.05
"""Mean share of the squared rest that it leaves at most, and of any joint."""
MUCH, ALIKE, NEARLY = 0.7, 2.0, 1.25
"""Factor by which either half of the recording may tell another one where it leaves that much at
most, and where it leaves more."""


def time_constant(
    model: Model, proposal: Proposal, seen: Sequence[Seen], above: float
) -> tuple[float, tuple[str, ...]] | None:
    """Its time constant [s], and the channels that have to lag; None where none is told.

    Args:
        model: an arm, as described.
        above: speed from which a joint moves [rad/s].
    """
    matches = {one.channel: one for one in proposal.matches}
    wanted, inputs = (*model.inputs, *model.outputs), model.inputs.names
    used = [matches[one.name] for one in wanted if one.name in matches]
    tables = {one.source for one in used}
    t = seen[used[0].source].t if used else None
    asked = any(not isinstance(one.scale, float) for one in used if one.channel in inputs)
    outputs = all(name in matches for name in model.outputs.names)
    if len(tables) != 1 or t is None or asked or not outputs or len(t) < LEAST:
        return None
    step = float(np.median(np.diff(t)))
    columns = [_values(one, matches, seen[used[0].source], step) for one in wanted]
    if not step > 0.0 or any(column is None for column in columns):
        return None
    values = np.column_stack([column for column in columns if column is not None])
    holes = np.flatnonzero(~np.isfinite(values).all(axis=1))
    values = max((part[1:] for part in np.split(values, holes)), key=len)
    found = _told(model, values, step, above) if len(values) >= LEAST else 0.0
    names = (one.name for one in model.inputs if one.name in matches)
    return (found, tuple(names)) if found else None


def _values(one: Channel, matches: dict[str, Match], table: Seen, step: float) -> Vector | None:
    """A channel [SI]; derived from the one that it is the change of, where nothing says it."""
    if one.name in matches:
        match = matches[one.name]
        scale = match.scale if isinstance(match.scale, float) else 1.0
        found: Vector = to_si(table.values(match.column) * scale + match.offset, match.unit)
        return found
    before = one.name.replace("qdd", "qd") if "qdd" in one.name else one.name.replace("qd", "q")
    if before == one.name:
        return None
    of = _values(Channel(before, "1"), matches, table, step)
    return None if of is None else np.gradient(of, step)


def _told(model: Model, values: Float64[np.ndarray, "n channels"], step: float,
          above: float) -> float:  # fmt: skip
    """The time constant that both halves of the rows tell about the same; 0: there is none."""
    nu, ny = len(model.inputs), len(model.outputs)
    u, tau = values[:, :nu], values[:, nu:]
    predicted = mapped(model, u, np.full(len(u), step), model.parameters.values)
    v, a = u[:, ny : 2 * ny], u[:, 2 * ny : 3 * ny]
    basis = np.stack([predicted, np.sign(v), v, a, np.ones(v.shape)], axis=2)
    if 2.0 * SMOOTHED * step < 1.0:
        low = Symmetric.butterworth(SMOOTHED, 1.0 / step)
        basis, tau = low.smooth(basis.reshape(len(u), -1)).reshape(basis.shape), low.smooth(tau)
    tried = np.concatenate([[NONE * step], np.geomspace(0.25 * step, LONGEST, STEPS)])
    lagging = [_behind(basis, step / one) for one in tried.tolist()]
    rows = np.unique(np.linspace(0, len(u) - 1, ROWS).astype(int))
    half = len(rows) // 2
    (whole, left), (first, _), (second, _) = (
        _best(tried, np.array([_left(one[some], tau[some], np.abs(v[some]) > above)
                               for one in lagging]))
        for some in (rows, rows[:half], rows[half:])
    )  # fmt: skip
    apart = ALIKE if left <= MUCH else NEARLY
    alike = min(first, second) > 0.0 and max(first, second) <= apart * min(first, second)
    return float(f"{whole:.2g}") if alike else 0.0


def _behind(
    basis: Float64[np.ndarray, "n ny terms"], passed: float
) -> Float64[np.ndarray, "n ny terms"]:
    """Behind a first-order low pass, ``passed`` of its time constants from row to row."""
    stay = math.exp(-passed)
    found = scipy.signal.lfilter([1.0 - stay], [1.0, -stay], basis, axis=0, zi=stay * basis[:1])[0]
    return np.asarray(found)


def _best(tried: Vector, lefts: Float64[np.ndarray, "tried ny"]) -> tuple[float, float]:
    """The one that leaves least of all joints, between those tried, and the mean share of the rest
    that it leaves; 0 and 1: it does not pay."""
    known = np.isfinite(lefts).all(axis=0) & (lefts[0] > 0.0)
    if not known.any():
        return 0.0, 1.0
    share = lefts[:, known] / lefts[0, known]
    score = np.log(share).mean(axis=1)
    best = int(np.argmin(score))
    if score[best] > math.log(LEFT) or share[best].max() > WORST:
        return 0.0, 1.0
    low, high = max(best - 1, 1), min(best + 1, len(tried) - 1)
    bend = score[low] - 2.0 * score[best] + score[high]
    by = 0.5 * (score[low] - score[high]) / bend if bend > 0.0 and low < best < high else 0.0
    found = float(tried[best] * (tried[high] / tried[best]) ** by)
    return found, math.exp(float(score[best]))


def _left(basis: Float64[np.ndarray, "n ny terms"], tau: Outputs,
          moving: Bool[np.ndarray, "n ny"]) -> Vector:  # fmt: skip
    """Mean square of each torque that is left, (ny,); NaN where a joint hardly moves."""
    out = np.full(tau.shape[1], np.nan)
    for j, on in enumerate(moving.T):
        if np.count_nonzero(on) >= LEAST:
            a, b = basis[on, j], tau[on, j]
            out[j] = np.mean(np.square(b - a @ np.linalg.lstsq(a, b, rcond=None)[0]))
    return out
