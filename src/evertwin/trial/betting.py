"""Sequential evidence from paired losses: bet on the challenger, count the money.

Champion and challenger predict the same segments, so their deviations ``c`` and ``x`` come in
pairs. Under the null hypothesis "the challenger is not better by the margin ``m``" the payoff

    d = ((1 − m)·c − x) / s,      s = 2 · rms of the x seen before

has no positive mean, whatever the unit of the losses. Whoever bets a share λ of its wealth on each
payoff cannot expect to gain: the wealth Π(1 + λ·d), averaged over a grid of λ, exceeds 1/α with
probability α at most, at whatever row one looks (Ville's inequality). ``s`` is known before the
bet. A payoff below −1 is cut to −1 (a wealth cannot turn negative): a loss that large helps the
challenger here, and counts in full in the pooled gain that the gate asks for besides.

Deviations follow each other, they are not independent. So the same bets are also placed on means
over 2, 4, 8 and 16 segments, and a logarithm of wealth counts divided by the inflation of the
variance ``τ = (1 + ρ)/(1 − ρ)``, ρ the lag-1 autocorrelation of the payoffs plus half its standard
error: bets λ/τ on payoffs whose sum varies τ times as much come to that. Blocks in which both are
off alike (the machine stands, say) add next to nothing to that sum or its variance, so ρ is of the
others: taken along, standing and moving in turn would pass for one long run of luck. So would a
challenger that is several times better, and more and more so while the machine moves away from the
champion: by how much is left out of ρ. The evidence is the mean wealth over all lengths.

What favours one of two versions for longer than the segments so far have lasted cannot be told from
their worth: α holds where such spells last a few segments (`python -m proofs.gate`).

Sources: Waudby-Smith and Ramdas, "Estimating means of bounded random variables by betting" (2024);
METHOD: a sequential test on the paired loss.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.types import Float64, Int64

LENGTHS = np.array([1, 2, 4, 8, 16], dtype=np.int64)
"""Segments per block."""
GRID = np.array([0.05, 0.1, 0.2, 0.4, 0.7, 0.95])
"""Shares λ of the wealth that are bet."""
WARM = 2
"""Blocks that only set the scale s."""
SPREAD = 2.0
"""s in rms of the challenger's deviations."""
CEILING = 20.0
"""Payoffs are cut above this: one block must not decide alone."""
ALIKE = 0.05
"""Share by which deviations differ at most that count as alike."""
CLEAR = 0.4
"""Relative payoff, (c − x)/(c + x), above which its size counts for nothing in ρ: the challenger
leaves 0.43 of the deviation, or less."""
STEADIEST = 0.95
"""Lag-1 autocorrelation of payoffs that is assumed at most."""


class Bets(NamedTuple):
    """Wealth and statistics per block length.

    >>> open_bets().wealth.shape
    (5, 6)
    """

    part: Float64[np.ndarray, "lengths 3"]
    """Of the block so far: Σc, Σx, segments."""
    blocks: Int64[np.ndarray, " lengths"]
    """Blocks finished."""
    square: Float64[np.ndarray, " lengths"]
    """Σx² over finished blocks."""
    wealth: Float64[np.ndarray, "lengths shares"]
    """Logarithm of the wealth per share."""
    serial: Float64[np.ndarray, "lengths 6"]
    """Of the relative payoffs v that are not alike: Σv, Σv², Σv·v(before), first, last, count."""
    before: Float64[np.ndarray, "lengths shares"]
    """Evidence of the challengers before, whose places were taken."""


def open_bets() -> Bets:
    """Bets before the first segment: wealth 1."""
    k = len(LENGTHS)
    return Bets(
        np.zeros((k, 3)), np.zeros(k, dtype=np.int64), np.zeros(k), np.zeros((k, len(GRID))),
        np.zeros((k, 6)), np.zeros((k, len(GRID))),
    )  # fmt: skip


def passed_on(bets: Bets) -> Bets:
    """Bets on the next challenger: evidence of stretches that follow each other multiplies."""
    inflation = np.array([_inflation(serial) for serial in bets.serial])
    known = np.where(bets.wealth > 0.0, bets.wealth / inflation[:, None], bets.wealth)
    return open_bets()._replace(before=bets.before + known)


@njit(cache=True)
def place(c: float, x: float, margin: float, lengths: Any, grid: Any, bets: Any) -> None:
    """One segment with deviations ``c`` and ``x`` goes into the bets, in place."""
    part, blocks, square, wealth, serial, _ = bets
    for level in range(len(lengths)):
        part[level, 0] += c
        part[level, 1] += x
        part[level, 2] += 1.0
        if part[level, 2] < lengths[level]:
            continue
        champion, challenger = part[level, 0], part[level, 1]
        part[level, :] = 0.0
        n = blocks[level]
        gain = (1.0 - margin) * champion - challenger
        scale = SPREAD * math.sqrt(square[level] / max(n, 1))
        if n >= WARM and (scale > 0.0 or gain != 0.0):
            payoff = CEILING if scale == 0.0 and gain > 0.0 else gain / max(scale, 1e-300)
            payoff = min(max(payoff, -1.0), CEILING)
            for j in range(len(grid)):
                wealth[level, j] += math.log1p(grid[j] * payoff)
        if abs(champion - challenger) > ALIKE * max(champion, challenger):
            relative = min(gain / (champion + challenger), CLEAR)
            serial[level, 0] += relative
            serial[level, 1] += relative * relative
            if serial[level, 5] == 0.0:
                serial[level, 3] = relative
            else:
                serial[level, 2] += relative * serial[level, 4]
            serial[level, 4] = relative
            serial[level, 5] += 1.0
        square[level] += challenger * challenger
        blocks[level] = n + 1


@njit(cache=True)
def evidence(bets: Any) -> float:
    """Logarithm of the e-value."""
    _, blocks, _, wealth, serial, before = bets
    total, counted = 0.0, 0
    for level in range(len(blocks)):
        n = blocks[level]
        if n <= WARM and not before[level].any():
            continue
        counted += 1
        inflation = _inflation(serial[level])
        for share in range(wealth.shape[1]):
            log = wealth[level, share]
            log = before[level, share] + (log / inflation if log > 0.0 else log)
            total += math.exp(min(log, 600.0))
    return math.log(total / counted / wealth.shape[1]) if counted else 0.0


@njit(cache=True)
def _inflation(serial: Any) -> float:
    """By what serial correlation inflates the mean square of payoffs, from their running sums: by
    their variance, not the square of their mean."""
    told = max(serial[5], 1.0)
    rho = min(_correlation(told, serial) + 0.5 / math.sqrt(told), STEADIEST)
    square, mean = serial[1] / told, serial[0] / told
    varies = 1.0 - mean * mean / square if square > 0.0 else 1.0
    return float(1.0 + varies * max((1.0 + rho) / (1.0 - rho) - 1.0, 0.0))


@njit(cache=True)
def _correlation(n: float, serial: Any) -> float:
    """Lag-1 autocorrelation of n payoffs from their running sums."""
    mean = serial[0] / n
    variance = serial[1] / n - mean * mean
    if variance <= 1e-12 * serial[1] / n:
        return 0.0
    pairs = serial[2] - mean * (2 * serial[0] - serial[3] - serial[4]) + (n - 1) * mean * mean
    return float(pairs / n / variance)
