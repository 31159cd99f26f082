"""Below which frequency a derived acceleration is motion, and no noise.

Noise of a place grows in its second derivative with the square of the frequency, and motion does
not. A filter over both sides of a fit leaves its numbers as they are, so it passes what is motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.gauges.changes.noise import rounding
from evertwin.signals.fir import Symmetric
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK, Proposal
from evertwin.tuning.form.noisy_inputs import white
from evertwin.types import Vector

USUAL, PART = 5.0, 5.0
"""Hz, and part of the rate, that a cutoff is below."""
TRIED = (3.0, 2.0, 1.5, 1.0, 0.7, 0.5)
"""Lower ones [Hz], the highest first: what is lower comes late."""
SHARE = 0.02
"""Of the variance of what is derived that noise may be: its number is too small by as much."""


def cutoff(proposal: Proposal, seen: Sequence[Seen], rate: float) -> float:
    """Cutoff [Hz] of a static map with ``rate`` rows per second: the highest at which what one axis
    derives is hardly noise, else the usual one."""
    usual = min(USUAL, rate / PART)
    derived = [one for one in proposal.derivations if one.op == "derivative"]
    places = {one.of[0] for one in derived} - {one.name for one in derived}
    found = [m for m in proposal.matches if m.channel in places and m.column != ASK]
    if len(found) != 1 or seen[found[0].source].clock is None:
        return usual
    table = seen[found[0].source]
    t, x = table.clock, table.values(found[0].column)
    assert t is not None
    every = max(round(1.0 / (rate * float(np.median(np.diff(t))))), 1)
    x = x[np.isfinite(x)][::every]
    shares = {one: share(x, one, rate, len(derived)) for one in (usual, *TRIED) if one <= usual}
    least = min(shares, key=shares.__getitem__)
    return next((one for one, of in shares.items() if of <= SHARE), least)


def share(x: Vector, cutoff: float, rate: float, times: int) -> float:
    """Which part of the variance of what is derived so many ``times`` of ``x``, and filtered, is
    noise; infinite where ``x`` (n,) is too short for that.

    >>> rng, t = np.random.default_rng(0), np.arange(3000) * 0.02
    >>> x = np.sin(3 * t) + rng.normal(0.0, 0.002, 3000)
    >>> share(x, 5.0, 50.0, 2) > 0.002 > share(x, 2.0, 50.0, 2)
    True
    """
    noise = max(float(white(x[:, None], np.ones(len(x), dtype=bool))[0]), rounding([np.diff(x)]))
    half = Symmetric.butterworth(cutoff, rate).half
    weights = np.concatenate([half[:0:-1], half])
    for _ in range(times):
        weights = np.convolve(weights, [0.5 * rate, 0.0, -0.5 * rate])
    if len(x) <= 2 * len(weights):
        return np.inf
    size = float(np.var(np.convolve(x, weights, mode="valid")))
    return noise**2 * float(weights @ weights) / size if size > 0.0 else np.inf
