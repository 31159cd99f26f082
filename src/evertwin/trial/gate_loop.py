"""The compiled loop of the gate: segments in, until a decision is reached.

Sums are kept one segment after the other, so where the segments are cut cannot matter.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.compiled.functions import njit
from evertwin.trial.betting import evidence, place

OPEN, OTHER, STAYS = 0, 1, 2
"""Undecided; the other version is better; it is not, or not within the limit."""
ENDLESS = 1e75
"""Deviation of a simulation that runs away: more than any other, and its square is a number."""


@njit(cache=True)
def run(losses: Any, rule: Any, lengths: Any, grid: Any, state: Any) -> None:
    """Folds segments into the state until it is decided; the rest is left out.

    Args:
        losses: per segment: mean of (residual / scale)² of the live version and of the other, then
            per safety measure both counts, (m, 2 + 2·measures).
        rule: margin to prove, log e-value for, log e-value against, pooled gain, segments at least,
            segments at most.
        lengths: segments per block.
        grid: shares of the wealth.
        state: as of `evertwin.trial.gate.GateState`.
    """
    ahead, back, sums, harm, tally = state
    for i in range(losses.shape[0]):
        if tally[0] != OPEN:
            return
        live, other = _deviation(losses[i, 0]), _deviation(losses[i, 1])
        place(live, other, rule[0], lengths, grid, ahead)
        place(other, live, 0.0, lengths, grid, back)
        sums[0] += live
        sums[1] += other
        sums[2] += live * live
        sums[3] += other * other
        for j in range(harm.shape[0]):
            harm[j] += losses[i, 2 + j]
        tally[1] += 1
        tally[0] = _verdict(rule, ahead, back, sums, harm, tally)


@njit(cache=True)
def _deviation(loss: float) -> float:
    return min(math.sqrt(loss), ENDLESS)


@njit(cache=True)
def since_better(losses: Any, rule: Any, lengths: Any, grid: Any, state: Any) -> int:
    """Folds segments into bets on the other version, which begin anew wherever the live one has
    deviated less since they began; the index of the deciding segment, −1: none decides.

    Args as in `run`, but: ``losses`` of both versions, and the last row, (m, 3); the last
    of ``rule`` is how often they have to have begun anew, which ``harm`` counts, before the last
    row of their first segment and, unless a checkpoint is older than that, the sum of the squared
    differences of both since.
    """
    ahead, _, sums, harm, tally = state
    for i in range(losses.shape[0]):
        if tally[0] != OPEN:
            return -1
        live, other = _deviation(losses[i, 0]), _deviation(losses[i, 1])
        if sums[1] + other >= sums[0] + live:
            sums[:], tally[:] = 0.0, 0
            ahead[0][:], ahead[1][:], ahead[2][:] = 0.0, 0, 0.0
            ahead[3][:], ahead[4][:], ahead[5][:] = 0.0, 0.0, 0.0
            harm[0] += 1.0
            harm[2:] = 0.0
            continue
        if tally[1] == 0:
            harm[1] = losses[i, 2]
        # by the sum of both: a few large deviations while the machine goes back must not decide
        harm[2:] += (live - other) * (live - other)
        whole = max(live + other, 1e-300)
        place(live / whole, other / whole, rule[0], lengths, grid, ahead)
        sums[0] += live
        sums[1] += other
        sums[2] += live * live
        sums[3] += other * other
        tally[1] += 1
        enough = tally[1] >= rule[4] and harm[0] >= rule[5] and sums[1] <= (1.0 - rule[3]) * sums[0]
        if enough and evidence(ahead) >= rule[1]:
            tally[0] = OTHER
            return i
    return -1


@njit(cache=True)
def _verdict(rule: Any, ahead: Any, back: Any, sums: Any, harm: Any, tally: Any) -> int:
    """The verdict after this segment."""
    gain = 1.0 - sums[1] / sums[0] if sums[0] > 0.0 else 0.0
    if tally[1] >= rule[4]:
        if gain >= rule[3] and not unsafe(harm) and evidence(ahead) >= rule[1]:
            return OTHER
        if gain < 0.0 and evidence(back) >= rule[2]:
            return STAYS
    return STAYS if tally[1] >= rule[5] else OPEN


@njit(cache=True)
def unsafe(harm: Any) -> bool:
    """True if a count of the other version is larger by more than two standard deviations."""
    for j in range(0, harm.shape[0], 2):
        if harm[j + 1] - harm[j] > 2.0 * math.sqrt(harm[j] + harm[j + 1]):
            return True
    return False
