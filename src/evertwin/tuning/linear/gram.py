"""The compiled loops of the closed form: sums over rows, then a small system of equations.

Rows are summed per output with the few columns that act on it, so that 69,000 rows of a 6-axis arm
need 6 small matrices and no large one. Weights come afterwards and cost no second pass.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit

FINE, SINGULAR, ILL = 0, 1, 2
"""Return codes of `normal`: solved; a parameter has no effect; too ill-conditioned."""


class Estimate(NamedTuple):
    """What `normal` fills.

    >>> Estimate._fields
    ('change', 'covariance', 'noise', 'dof')
    """

    change: Any
    """How the parameters have to change, (k,)."""
    covariance: Any
    """(k, k)."""
    noise: Any
    """Variance of each output's noise, and its degrees of freedom, (ny,)."""
    dof: Any


@njit(cache=True)
def residual(y: Any, y0: Any, columns: Any, at: Any, values: Any) -> Any:
    """``y − y0 − columns·p`` (n, ny), with p the ``values`` (k,) ``at`` (ny, t), −1: none."""
    n, ny, t = columns.shape
    out, p = np.empty((n, ny)), np.zeros((ny, t))
    for k in range(ny):
        for a in range(t):
            if at[k, a] >= 0:
                p[k, a] = values[at[k, a]]
    for i in range(n):
        for k in range(ny):
            total = y[i, k] - y0[i, k]
            for a in range(t):
                total -= columns[i, k, a] * p[k, a]
            out[i, k] = total
    return out


@njit(cache=True)
def slotted(columns: Any, tuned: Any) -> Any:
    """See `evertwin.tuning.linear.closed.slots`."""
    ny, m = columns.shape
    slot, at, width = np.full((ny, m), -1), np.full((ny, m), -1), 0
    for o in range(ny):
        count = 0
        for a in range(m):
            for j in range(len(tuned)):
                if columns[o, a] == tuned[j]:
                    slot[o, a], at[o, count] = count, j
                    count += 1
        width = max(width, count)
    return slot, at[:, :width].copy()


@njit(cache=True)
def gram(r: Any, phi: Any, products: Any, sides: Any, squares: Any, count: Any) -> None:
    """Adds rows to ``products`` (ny,m,m), ``sides`` (ny,m), ``squares`` (ny,), ``count`` (ny,).

    ``r`` (n, ny): residuals; a row where it is NaN is left out.
    """
    n, ny, m = phi.shape
    for i in range(n):
        for k in range(ny):
            e = r[i, k]
            if e != e:
                continue
            squares[k] += e * e
            count[k] += 1
            for a in range(m):
                f = phi[i, k, a]
                sides[k, a] += f * e
                for b in range(a + 1):
                    products[k, a, b] += f * phi[i, k, b]


@njit(cache=True)
def effects(columns: Any, at: Any, used: Any, direction: Any, heavy: Any, out: Any) -> None:
    """Adds Σ z², Σ z⁴ of the effect of a ``direction`` (k,) on the rows to ``out`` (3, ny).

    Then the number of rows on which any of the ``heavy`` parameters (k,) acts. ``columns``
    (n, ny, m) belong to the parameters ``at`` (ny, m); only ``used`` (n, ny) rows count.
    """
    n, ny, m = columns.shape
    for i in range(n):
        for o in range(ny):
            if not used[i, o]:
                continue
            z, acts = 0.0, False
            for a in range(m):
                j = at[o, a]
                if j >= 0:
                    z += columns[i, o, a] * direction[j]
                    acts |= heavy[j] and columns[i, o, a] != 0.0
            out[0, o] += z * z
            out[1, o] += z * z * z * z
            out[2, o] += acts


@njit(cache=True)
def widened(products: Any, at: Any, out: Any) -> None:
    """Adds ``products`` (ny,m,m) of columns (lower triangle) to ``out`` (ny,k,k) of parameters."""
    for o in range(at.shape[0]):
        for a in range(at.shape[1]):
            for b in range(a + 1):
                i, j = at[o, a], at[o, b]
                if i < 0 or j < 0:
                    continue
                out[o, i, j] += products[o, a, b]
                if a != b:
                    out[o, j, i] += products[o, a, b]


@njit(cache=True, error_model="numpy")
def weighed(blocks: Any, sigma: Any) -> Any:
    """Σ of ``blocks`` (ny, k, k) over σ², (k, k)."""
    ny, k = blocks.shape[:2]
    out = np.zeros((k, k))
    for o in range(ny):
        for i in range(k):
            for j in range(k):
                # twice, since the square of a tiny noise is zero
                out[i, j] += blocks[o, i, j] / sigma[o] / sigma[o]
    return out


@njit(cache=True, error_model="numpy")
def unit(h: Any) -> Any:
    """(length √H_jj of each column of ``h`` (k, k), H with columns of unit length or none)."""
    k = len(h)
    length, out = np.empty(k), np.zeros((k, k))
    for j in range(k):
        length[j] = np.sqrt(max(h[j, j], 0.0))
    for i in range(k):
        for j in range(k):
            if length[i] > 0.0 and length[j] > 0.0:
                out[i, j] = h[i, j] / length[j] / length[i]
    return length, out


@njit(cache=True, error_model="numpy")
def inverted(spectrum: Any, least: float) -> Any:
    """H⁻¹ (k, k) of an `evertwin.tuning.linear.sensitivity.Spectrum`, in the directions whose
    square is above the part ``least`` of the largest."""
    length, squares, vectors = spectrum
    k, most = len(length), 0.0
    out, turned = np.zeros((k, k)), np.empty(k)
    for value in squares:
        most = max(most, value)
    for a in range(len(squares)):
        if not squares[a] > least * most:
            continue
        for j in range(k):
            turned[j] = vectors[j, a] / length[j] if length[j] > 0.0 else 0.0
        for i in range(k):
            for j in range(k):
                out[i, j] += turned[i] * turned[j] / squares[a]
    return out


@njit(cache=True, error_model="numpy")
def combined(parts: Any, inverse: Any, information: Any, rows: Any, paid: Any) -> Any:
    """(covariance (k,k), degrees of freedom (k,)) of the parameters, after Satterthwaite.

    Args:
        parts: what each output adds to their variance, (ny, k).
        inverse: of the information, the prior's ``information`` (k,) included.
        rows: each output's effective rows, (ny,); infinite where its noise is known.
        paid: number of parameters that they pay for, (ny,).
    """
    ny, k = parts.shape
    covariance, degrees, factor = np.empty((k, k)), np.empty(k), np.empty(k)
    for j in range(k):
        variance, spread = 0.0, 0.0
        for o in range(ny):
            variance += parts[o, j]
            spread += parts[o, j] * parts[o, j] / max(rows[o] - paid[o], 1.0)
        for i in range(k):
            variance += inverse[i, j] * inverse[i, j] * information[i]
        found = variance * variance / spread
        degrees[j] = max(found, 1.0) if found == found else np.inf
        factor[j] = np.sqrt(variance / inverse[j, j])
        if not factor[j] < np.inf:
            factor[j] = 1.0
    for i in range(k):
        for j in range(k):
            covariance[i, j] = inverse[i, j] * factor[j] * factor[i]
    return covariance, degrees


@njit(cache=True)
def _factor(h: Any, root: Any) -> float:
    """Cholesky factor of ``h`` in ``root`` (lower); the smallest pivot, 0 if not positive."""
    k = h.shape[0]
    smallest = 1.0
    for i in range(k):
        for j in range(i + 1):
            s = h[i, j]
            for a in range(j):
                s -= root[i, a] * root[j, a]
            if i != j:
                root[i, j] = s / root[j, j]
                continue
            smallest = min(smallest, s)
            if s <= 0.0:
                return 0.0
            root[i, i] = np.sqrt(s)
    return smallest


@njit(cache=True)
def _inverse(root: Any, out: Any) -> None:
    """(root rootᵀ)⁻¹ into ``out``."""
    k = root.shape[0]
    inv = np.zeros((k, k))
    for j in range(k):
        inv[j, j] = 1.0 / root[j, j]
        for i in range(j + 1, k):
            s = 0.0
            for a in range(j, i):
                s -= root[i, a] * inv[a, j]
            inv[i, j] = s / root[i, i]
    for i in range(k):
        for j in range(i + 1):
            s = 0.0
            for a in range(i, k):
                s += inv[a, i] * inv[a, j]
            out[i, j] = s
            out[j, i] = s


@njit(cache=True)
def normal(sums: tuple[Any, ...], at: Any, information: Any, scale: Any, out: Estimate) -> int:
    """Solves for the change and its covariance, weighting outputs by their noise.

    Args:
        sums: products, sides, squares and count from `gram`.
        at: position of each column in the change, −1 for a column that stays, (ny, m).
        information: prior 1/σ², (k,).
        scale: standard deviation of each output's noise, NaN where unknown: two rounds.
    """
    products, sides, squares, count = sums
    ny, k = len(at), len(out.change)
    weight, root, d = np.ones(ny), np.zeros((k, k)), np.empty(k)
    known = True
    for o in range(ny):
        if scale[o] == scale[o]:
            weight[o] = 1.0 / (scale[o] * scale[o])
        else:
            known = False
            weight[o] = count[o] / squares[o] if squares[o] > 0.0 else 1.0
    for _ in range(1 if known else 2):
        h, g = _assembled(products, sides, at, information, weight)
        for j in range(k):
            if not h[j, j] > 0.0:
                return SINGULAR
        _balance(h, d)
        if not _factor(h, root) > 1e-9:
            return ILL
        _covary(root, d, out.covariance)
        for i in range(k):
            out.change[i] = 0.0
            for j in range(k):
                out.change[i] += out.covariance[i, j] * g[j]
        _spread(sums, at, weight, out)
        for o in range(ny):
            if scale[o] != scale[o] and out.noise[o] > 0.0:
                weight[o] = 1.0 / out.noise[o]
    if not known:
        # The last weights are those of the round before: rescaled to the noise that was found.
        h, _ = _assembled(products, sides, at, information, weight)
        _balance(h, d)
        if _factor(h, root) > 1e-12:
            _covary(root, d, out.covariance)
    return FINE


@njit(cache=True)
def _assembled(products: Any, sides: Any, at: Any, information: Any, weight: Any) -> Any:
    """The matrix and the right side of the normal equations."""
    (ny, m), k = at.shape, len(information)
    h, g = np.zeros((k, k)), np.zeros(k)
    for j in range(k):
        h[j, j] = information[j]
    for o in range(ny):
        for a in range(m):
            ia = at[o, a]
            if ia < 0:
                continue
            g[ia] += weight[o] * sides[o, a]
            for b in range(a + 1):
                ib = at[o, b]
                if ib < 0:
                    continue
                h[ia, ib] += weight[o] * products[o, a, b]
                if a != b:
                    h[ib, ia] += weight[o] * products[o, a, b]
    return h, g


@njit(cache=True)
def _balance(h: Any, d: Any) -> None:
    """``h`` with a diagonal of ones; ``d`` is filled with the roots of what it was."""
    for j in range(len(d)):
        d[j] = np.sqrt(h[j, j])
    for i in range(len(d)):
        for j in range(len(d)):
            h[i, j] /= d[i] * d[j]


@njit(cache=True)
def _covary(root: Any, d: Any, covariance: Any) -> None:
    """The inverse of what was balanced, from its factor."""
    _inverse(root, covariance)
    for i in range(len(d)):
        for j in range(len(d)):
            covariance[i, j] /= d[i] * d[j]


@njit(cache=True)
def _spread(sums: tuple[Any, ...], at: Any, weight: Any, out: Estimate) -> None:
    """Each output's noise variance: its sum of squares over its degrees of freedom."""
    products, sides, squares, count = sums
    ny, m = at.shape
    for o in range(ny):
        s, used = squares[o], 0.0
        for a in range(m):
            ia = at[o, a]
            if ia < 0:
                continue
            s -= 2.0 * sides[o, a] * out.change[ia]
            for b in range(m):
                ib = at[o, b]
                if ib < 0:
                    continue
                f = products[o, a, b] if b <= a else products[o, b, a]
                s += f * out.change[ia] * out.change[ib]
                used += weight[o] * f * out.covariance[ia, ib]
        out.dof[o] = max(count[o] - used, 1.0)
        # Below the rounding of the sums nothing is known about the noise.
        out.noise[o] = max(s, 1e-15 * squares[o]) / out.dof[o]


@njit(cache=True)
def solved(r: Any, columns: Any, at: Any, information: Any, scale: Any) -> Any:
    """(change, noise, blocks, code): a small system from residuals (n, ny) and columns (n, ny, t).

    How the parameters have to change, (k,); noise of each output, (ny,); what each output tells of
    the parameters at unit noise, (ny, k, k); return code.

    Args:
        at: position of each column among the parameters, −1: none, (ny, t).
        information: prior 1/σ², (k,).
        scale: standard deviation of each output's noise, NaN where unknown.
    """
    ny, t = at.shape
    k = len(information)
    products, sides = np.zeros((ny, t, t)), np.zeros((ny, t))
    squares, count = np.zeros(ny), np.zeros(ny)
    gram(r, columns, products, sides, squares, count)
    blocks = np.zeros((ny, k, k))
    widened(products, at, blocks)
    out = Estimate(np.zeros(k), np.empty((k, k)), np.zeros(ny), np.zeros(ny))
    code = normal((products, sides, squares, count), at, information, scale, out)
    return out.change, np.sqrt(out.noise), blocks, code
