"""The compiled loops of the residual statistics; every sum runs over the rows in their order."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.compiled.functions import instead, njit
from evertwin.tuning.linear.gram import inverted
from evertwin.tuning.residuals.classes_loop import BINS

LANES = 6
"""Outputs that are summed side by side: as many as most arms have."""
LAGS = 20
"""Lags that the whiteness test looks at."""
MOST = 4000
"""Largest lag that an autocorrelation is followed to."""
LONG = -1
"""Reach of a residual that remembers longer than `LAGS`."""
_PIECE = 8192
"""Rows that are summed at a time: below what the linear algebra library starts threads for."""
_NEAR = 512
"""Rows that stay near the processor."""


class Memory(NamedTuple):
    """What residuals remember: fields of `evertwin.tuning.residuals.autocorrelation.Correlation`.

    >>> Memory._fields[:4]
    ('centred', 'known', 'rows', 'square')
    """

    centred: Any
    known: Any
    rows: Any
    square: Any
    short: Any
    reach: Any
    statistic: Any


@njit(cache=True)
def tally(y: Any, r: Any, moving: Any) -> Any:
    """(sums, roots) of the rows whose ``r`` (n, ny) is known.

    Sums (7, ny): count, Σ y², Σ r², then the same over the rows that are ``moving`` (n, ny); the
    count of known ``y``. Roots (3, ny): rms of the residual, the same over that of ``y``, and over
    the moving rows.
    """
    ny = r.shape[1]
    out, roots = np.zeros((7, ny)), np.empty((3, ny))
    for i in range(r.shape[0]):
        for k in range(ny):
            e, s = r[i, k], y[i, k] * y[i, k]
            out[6, k] += s == s
            if e != e:
                continue
            out[0, k] += 1.0
            out[1, k] += s
            out[2, k] += e * e
            if moving[i, k]:
                out[3, k] += 1.0
                out[4, k] += s
                out[5, k] += e * e
    for k in range(ny):
        for j, (above, below) in enumerate(((2, 0), (2, 1), (5, 4))):
            roots[j, k] = np.nan if out[above, k] == 0.0 else np.inf
            if out[below, k] > 0.0:
                roots[j, k] = np.sqrt(out[above, k] / out[below, k])
    return out, roots


@njit(cache=True)
def remember(r: Any) -> Any:
    """The `Memory` of residuals ``r`` (n, ny).

    Less the mean, 0 where unknown, and 1 where known (nothing if everywhere), both with outputs as
    rows, up to whole `LANES` of them, and zeros behind the rows of the data; known rows and sum of
    squares, (ny,); autocorrelation (ny, LAGS + 1); the last lag before it is lost in its own
    scatter, or `LONG`, (ny,); the statistic of Ljung and Box, (ny,).
    """
    n, ny = r.shape
    lanes = (ny + LANES - 1) // LANES * LANES
    holes = np.isnan(r).any()
    centred = np.zeros((lanes, n + LAGS))
    known = np.zeros((lanes if holes else 0, n + LAGS))
    rows, square, statistic = np.empty(ny), np.empty(ny), np.zeros(ny)
    rho, reach = np.zeros((ny, LAGS + 1)), np.empty(ny, np.int64)
    for k in range(ny):
        total, missing = 0.0, 0
        for i in range(n):
            e = r[i, k]
            if e == e:
                centred[k, i] = e
                total += e
            else:
                missing += 1
        rows[k] = n - missing
        mean = total / max(n - missing, 1)
        for i in range(n):
            if r[i, k] == r[i, k]:
                centred[k, i] -= mean
        if holes:
            for i in range(n):
                known[k, i] = r[i, k] == r[i, k]
        square[k] = _product(centred[k], n, 0)
        rho[k, 0] = 1.0
        if square[k] > 0.0:
            first = square[k] / max(rows[k], 1.0)
            for h in range(1, LAGS + 1):
                pairs = float(n - h) if missing == 0 else _product(known[k], n, h)
                rho[k, h] = _product(centred[k], n, h) / max(pairs, 1.0) / first
        reach[k] = _reach(rho[k], n, 2.0 / np.sqrt(max(rows[k], 1.0)))
        for h in range(1, min(LAGS, (n - missing) // 5) + 1):
            statistic[k] += rho[k, h] * rho[k, h] / (rows[k] - h)
        statistic[k] *= rows[k] * (rows[k] + 2.0)
    return Memory(centred, known, rows, square, rho, reach, statistic)


@instead("numpy:dot")
def _dot(a: Any, b: Any) -> float:
    """What compiled functions take SciPy's library for too: NumPy's own differs in the last bit."""
    return float(scipy.linalg.blas.ddot(a, b))


@njit(cache=True)
def _product(values: Any, n: int, lag: int) -> float:
    """Σ_t v(t)·v(t + lag) over ``n`` rows, which are zero behind them."""
    total = 0.0
    for a in range(0, n, _PIECE):
        b = min(a + _PIECE, n)
        total += _dot(values[a:b], values[a + lag : b + lag])
    return total


@njit(cache=True)
def _reach(rho: Any, n: int, border: float) -> int:
    """The last lag before ``rho`` falls below the ``border``."""
    most = max(1, min(n // 4, MOST))
    for h in range(1, min(LAGS, most) + 1):
        if abs(rho[h]) < border:
            return h - 1
    return most if most <= LAGS else LONG


@njit(cache=True)
def shifted(columns: Any, used: Any, rho: Any, out: Any) -> None:
    """Adds Σ_h ρ(h) Σ_t c(t)·c(t + h)ᵀ over h = 1, 2, … to ``out`` (m, m).

    ``columns`` c (n, m), of which the rows that are ``used`` (n,) count.
    """
    n, m = columns.shape
    lags = len(rho)
    rows, later = np.zeros((m, _NEAR + lags)), np.empty(_NEAR)
    for a in range(0, n, _NEAR):
        size = min(_NEAR, n - a)
        for k in range(m):
            for i in range(_NEAR + lags):
                t = a + i
                rows[k, i] = columns[t, k] if t < n and used[t] else 0.0
        for b in range(m):
            later[:] = 0.0
            for h in range(1, lags):
                part = rows[b, h : h + _NEAR]
                for i in range(_NEAR):
                    later[i] += rho[h] * part[i]
            for k in range(m):
                for i in range(size):
                    out[k, b] += rows[k, i] * later[i]


@njit(cache=True, error_model="numpy")
def propagated(
    spectrum: Any, least: float, sigma: Any, acting: tuple[Any, ...], memory: Memory
) -> Any:
    """(H⁻¹ (k, k), what each output's noise adds to the variance of the parameters (ny, k), its
    effective rows (ny,): n / (1 + 2 Σ ρ²)).

    Of outputs that remember longer than `LAGS` as if their noise were independent.

    Args:
        spectrum, least: of the information H; see `evertwin.tuning.linear.gram.inverted`.
        acting: columns, at, used, blocks of `evertwin.tuning.linear.sensitivity.Sensitivity`.
    """
    columns, at, used, blocks = acting
    rho, reach = memory.short, memory.reach
    inverse = inverted(spectrum, least)
    (ny, t), k = at.shape, len(inverse)
    out, found, gain = np.zeros((ny, k)), np.empty((t, t)), np.zeros((t, k))
    effective = memory.rows.copy()
    for o in range(ny):
        for i in range(k):
            for j in range(k):
                # twice, since the square of a tiny noise is zero
                w = blocks[o, i, j] / sigma[o] / sigma[o]
                if w != 0.0:
                    for a in range(k):
                        out[o, a] += inverse[i, a] * w * inverse[j, a]
        if reach[o] < 1:
            continue
        kept = 0.0
        for h in range(1, reach[o] + 1):
            kept += rho[o, h] * rho[o, h]
        effective[o] /= 1.0 + 2.0 * kept
        gain[:], found[:] = 0.0, 0.0
        for a in range(t):
            if at[o, a] >= 0:
                gain[a] = inverse[at[o, a]] / sigma[o]
        shifted(columns[:, o], used[:, o], rho[o, : reach[o] + 1], found)
        for j in range(k):
            more = 0.0
            for a in range(t):
                for b in range(t):
                    more += 2.0 * gain[a, j] * found[a, b] * gain[b, j]
            out[o, j] += max(more, 0.0)  # never below the value for independent noise
    return inverse, out, effective


@njit(cache=True)
def analysed(number: Any, count: Any, memory: Memory, overlap: Any) -> Any:
    """(inputs of several classes, variance of residuals between the classes of inputs).

    The second has a row for each output with each of these inputs of which no other one is certain
    to be less probable: output, input, the share of the residual's variance between the classes,
    and f, groups − 1 and rows − groups of its F test. f is NaN where there is nothing to test.

    Args:
        number, count: class of each input at each row, (nu, n), and rows of each class, (nu, BINS).
        overlap: rows that count as one, (ny, nu); nothing: those of the memory.
    """
    centred, known, rows, square, rho, reach, _ = memory
    ny, nu, n = len(rows), number.shape[0], number.shape[1]
    if not len(overlap):
        overlap = overlapped(number, count, rho, reach)
    share, f = np.zeros((ny, nu)), np.full((ny, nu), np.nan)
    above, below = np.zeros((ny, nu)), np.zeros((ny, nu))
    sums, counts = np.zeros((nu, BINS, LANES)), np.zeros((nu, BINS, LANES))
    for k in range(ny):
        lane = k % LANES
        if lane == 0:
            _by_class(number, centred[k : k + LANES], sums)
            if rows[k : k + LANES].min() < n:
                _by_class(number, known[k : k + LANES], counts)
            else:
                for j in range(nu):
                    for c in range(BINS):
                        counts[j, c] = count[j, c]
        for j in range(nu):
            groups, between = 0, 0.0
            for c in range(BINS):
                if counts[j, c, lane] > 0.0:
                    groups += 1
                    between += sums[j, c, lane] * sums[j, c, lane] / counts[j, c, lane]
            if groups < 2 or not square[k] > 0.0:
                continue
            part, left = between / square[k], rows[k] / overlap[k, j] - groups
            share[k, j], above[k, j], below[k, j] = part, groups - 1, left
            if left > 1.0 and part < 1.0:
                f[k, j] = part / (groups - 1) / ((1.0 - part) / left)
    told, m, vary = np.empty((ny * nu, 6)), 0, np.empty(nu, np.bool_)
    for j in range(nu):
        vary[j] = count[j].max() < n
    for k in range(ny):
        for j in range(nu):
            if vary[j] and _asked(k, j, share, f, above, below):
                told[m, 0], told[m, 1], told[m, 2] = k, j, share[k, j]
                told[m, 3], told[m, 4], told[m, 5] = f[k, j], above[k, j], below[k, j]
                m += 1
    return vary.sum(), told[:m]


@njit(cache=True)
def overlapped(number: Any, count: Any, rho: Any, reach: Any) -> Any:
    """1 + 2 Σ_h ρ(h)·ρ_c(h) of each output and input, at least 1, (ny, nu).

    Args:
        number, count: class of each input at each row, (nu, n), and rows of each class, (nu, BINS),
            whose autocorrelation is ρ_c.
        rho, reach: of a `Memory`; no output remembers longer than `LAGS`.
    """
    nu, n = number.shape
    most, found = reach.max(), np.ones((len(reach), nu))
    centred, other = np.zeros(n + most), np.zeros(most + 1)
    for j in range(nu):
        if most == 0:
            break
        mean = 0.0
        for c in range(BINS):
            mean += c * count[j, c] / n
        for i in range(n):
            centred[i] = number[j, i] - mean
        for h in range(most + 1):
            other[h] = _product(centred, n, h) / max(n - h, 1)
        if not other[0] > 0.0:
            continue
        for k in range(len(reach)):
            for h in range(1, reach[k] + 1):
                found[k, j] += 2.0 * rho[k, h] * other[h] / other[0]
            found[k, j] = max(found[k, j], 1.0)
    return found


@njit(cache=True)
def _asked(k: int, j: int, share: Any, f: Any, above: Any, below: Any) -> bool:
    """Does no other input beat ``j`` in all: share, fewer classes and more rows?"""
    for i in range(share.shape[1]):
        rows, other = below[k, j] + above[k, j], below[k, i] + above[k, i]
        beats = above[k, i] <= above[k, j] and other >= rows and f[k, i] == f[k, i]
        if beats and (share[k, i] > share[k, j] or (share[k, i] == share[k, j] and i < j)):
            return False
    return True


@njit(cache=True)
def _by_class(number: Any, values: Any, total: Any) -> None:
    """Sums ``values`` (LANES, n or more) by class of each input, ``total`` (nu, BINS, LANES)."""
    total[:] = 0.0
    for i in range(number.shape[1]):
        a, b, c, d = values[0, i], values[1, i], values[2, i], values[3, i]
        e, f = values[4, i], values[5, i]
        for j in range(number.shape[0]):
            s = total[j, number[j, i]]
            s[0] += a
            s[1] += b
            s[2] += c
            s[3] += d
            s[4] += e
            s[5] += f
