"""Fitting terms to predictions over the horizon, and scoring them on what was held out.

All numbers minimise one cost, Σ soft_l1(r/scale) over the rows looked at, by SciPy. What a fit
would predict of a fold that it had not seen follows without refitting: with residuals e and
Jacobian J at the optimum and weights W, leaving rows out moves the optimum by

    δ = (J'WJ + R)⁻¹ J'W e      over the rows that stay,       e_out − J_out·δ

exact for terms that are linear in their numbers (tables, surfaces; R is their prior), and to first
order for laws and lags: at a kink the first order is fiction. So it only ranks candidates; the one
that is to join is confirmed first, its numbers fitted anew without each fold.

What lies on a grid is solved under a prior; of those that its kind offers (smoothness, noise,
symmetry) the one that predicts held-out folds best is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.correction.evidence import Evidence, mean_deviation
from evertwin.correction.numbers.sliding import cost_of, slid
from evertwin.correction.stack import Part, Stack, bounded
from evertwin.models.corrected.corrected import effective_inputs
from evertwin.models.terms.contract import Candidate, GridTerm, Prior
from evertwin.types import Bools, Float64, Inputs, Vector

NEAR, PAYS = 0.01, 0.05
"""Held-out deviations this near are equal; a less symmetric prior must gain this much."""
TRIED = 2
"""Of many starts only these many, the best as they stand, are fitted."""
LITTLE, UNSURE = 0.05, 2.0
"""Rise of the deviation that does not matter while it is not sure, in its standard errors."""
SAME = 1e-3
"""A number whose neutral value raises the deviation by no more than this share changes nothing; on
n segments, by no more than 1/n, which is what Akaike asks of a number."""
EVALUATIONS = 20
"""Of one fit."""
ALL = slice(None)


class Free(NamedTuple):
    """The numbers that a fit may change: places in p, bounds, size of a considerable change.

    >>> Free._fields
    ('places', 'low', 'high', 'typical')
    """

    places: np.ndarray
    low: Vector
    high: Vector
    typical: Vector


class Scored(NamedTuple):
    """A stack, and how it predicts what it was not fitted to.

    >>> Scored._fields
    ('stack', 'deviations', 'detail', 'free')
    """

    stack: Stack
    deviations: Vector
    """Held-out deviation of every segment."""
    detail: str = ""
    """What was chosen on the way."""
    free: Free | None = None
    """Numbers that `confirm` fits anew without each fold; None: the deviations stay as they are,
    exact without numbers of laws or lags, to first order for those beside a grid."""

    @property
    def mean(self) -> float:
        """Mean held-out deviation."""
        return mean_deviation(self.deviations)


def fit_candidate(stack: Stack, candidate: Candidate, evidence: Evidence) -> Scored:
    """The stack with the candidate on top, its numbers fitted beside those of the base model; those
    of other terms as they are."""
    part = Part(
        candidate.term, candidate.starts[0], candidate.low, candidate.high, candidate.typical,
        candidate.fixed,
    )  # fmt: skip
    grown, at = stack.with_part(part)
    own = grown.parts[at].kind
    if isinstance(own, GridTerm):
        return _fit_grid(grown, at, own, evidence)
    first = grown.first(at)
    starts = []
    for values in candidate.starts:
        p = grown.p
        p[first : first + len(values)] = values
        starts.append(grown.with_p(p))
    free = _free(grown, (at,))
    if len(starts) > TRIED:
        starts = sorted(starts, key=partial(cost_of, evidence))[:TRIED]
    best, _ = min((_solve(s, free, evidence) for s in starts), key=lambda f: f[1])
    best = slid(best, (at,), evidence, partial(anew, parts=(at,), evidence=evidence))
    return score(best, free, evidence)


def refit(stack: Stack, evidence: Evidence) -> Scored:
    """All terms with few numbers fitted together; grids stay.

    A small grid is scored as if it had not seen the fold, too; a large one as it is.
    """
    few = tuple(k for k, part in enumerate(stack.parts) if part.few and part.low)
    if few or stack.tuned:
        stack = anew(stack, few, evidence)
        stack = slid(stack, few, evidence, partial(anew, parts=few, evidence=evidence))
    grids = tuple(
        k
        for k, part in enumerate(stack.parts)
        if isinstance(part.kind, GridTerm) and part.kind.rescored
    )
    if not few and not grids and not stack.tuned:
        residual = evidence.residual(stack.model, stack.p)
        return Scored(stack, evidence.deviations(residual))
    scored = score(stack, _free(stack, few + grids), evidence)
    return scored._replace(free=None) if grids else scored  # a grid is solved under its prior


def anew(stack: Stack, parts: Sequence[int], evidence: Evidence) -> Stack:
    """With the numbers of some parts, and those of the base model beside them, fitted."""
    return _solve(stack, _free(stack, parts), evidence)[0]


def started(stack: Stack, evidence: Evidence) -> Stack:
    """With what states of its terms began with in the first recording."""
    for k, part in enumerate(stack.parts):
        local = [one.name for one in part.kind.parameters(part.term, "1", "1")]
        own = [i for i, name in enumerate(local) if name in part.kind.initials]
        if own:
            ends = bounded(part)
            columns = (np.array(one)[own] for one in (ends.low, ends.high, ends.typical))
            free = Free(stack.first(k) + np.array(own), *columns)
            stack = _solve(stack, free, evidence, evidence.opening == 1)[0]
    return stack


def settled(stack: Stack, parts: Sequence[int], evidence: Evidence) -> Stack:
    """With every number of these parts that changes nothing at its neutral value, or little and not
    surely. A delay goes first, with the lag beside it fitted anew: each makes up for the other."""
    neutral, first_off = stack.model.parameters.values, _off(stack, evidence)
    enough = (1.0 + max(SAME, 1.0 / evidence.segments)) * mean_deviation(first_off)
    for k in parts:
        first, part = stack.first(k), stack.parts[k]
        names = [one.name for one in part.kind.parameters(part.term, "1", "1")]
        delays = {*part.kind.steps} - {*part.kind.slopeless}
        for i in sorted(range(len(names)), key=lambda at: (names[at] not in delays, -at)):
            p = stack.p.copy()
            p[first + i] = neutral[first + i]
            without = stack.with_p(p)
            if names[i] in delays and part.low and len(names) > 1:
                kept = replace(without.parts[k], fixed=(*part.fixed, i))
                held = replace(without, parts=(*stack.parts[:k], kept, *stack.parts[k + 1 :]))
                without = anew(held, (k,), evidence)
            off = _off(without, evidence)
            rise, mean = off - first_off, mean_deviation(off)
            unsure = rise.mean() < UNSURE * rise.std() / np.sqrt(len(rise))
            if mean <= enough or (unsure and mean <= (1.0 + LITTLE) * mean_deviation(first_off)):
                stack = without
    return stack


def _off(stack: Stack, evidence: Evidence) -> Vector:
    """Deviation of each segment."""
    return evidence.deviations(evidence.residual(stack.model, stack.p))


def _free(stack: Stack, parts: Sequence[int]) -> Free:
    rows = list(stack.tuned)
    rows += [
        (stack.first(k) + i, part.low[i], part.high[i], part.typical[i])
        for k in parts
        for part in (bounded(stack.parts[k]),)
        for i in range(len(part.values))
        if i not in part.fixed
    ]
    index, low, high, typical = zip(*rows, strict=True)
    return Free(np.array(index), np.array(low), np.array(high), np.array(typical))


def _jacobian(
    stack: Stack, free: Free, evidence: Evidence, at: Vector, rows: Bools | slice = ALL
) -> Float64[np.ndarray, "r k"]:
    """∂e/∂p by differences of a hundredth of a considerable change, inside the bounds."""
    p = np.tile(stack.p, (1 + len(free.places), 1))
    p[:, free.places] = at
    h = 0.01 * free.typical
    h = np.where(at + h <= free.high, h, -h)
    for k, place in enumerate(free.places):
        p[1 + k, place] = at[k] + h[k]
    base, *others = (r[rows].ravel() for r in evidence.residuals(stack.model, p))
    columns = np.empty((len(base), len(others)))
    for k, r in enumerate(others):
        columns[:, k] = (r - base) / h[k]
    return columns


def confirm(scored: Scored, evidence: Evidence) -> Scored:
    """The same stack, every fold predicted with numbers that were fitted without it."""
    stack, free = scored.stack, scored.free
    if free is None:
        return scored
    out = np.empty_like(evidence.known)
    for fold in range(int(evidence.fold.max()) + 1):
        own = evidence.fold == fold
        without = _solve(stack, free, evidence, ~own)[0]
        out[own] = evidence.residual(without.model, without.p)[own]
    return scored._replace(deviations=evidence.deviations(out), free=None)


def _solve(
    stack: Stack, free: Free, evidence: Evidence, rows: Bools | slice = ALL
) -> tuple[Stack, float]:
    p, model = stack.p, stack.model

    def residual(values: Vector) -> Float64[np.ndarray, " r"]:
        p[free.places] = values
        return evidence.residual(model, p)[rows].ravel()

    margin = 1e-9 * (1.0 + np.abs(free.typical))
    start = np.clip(p[free.places], free.low + margin, free.high - margin)
    result = scipy.optimize.least_squares(
        residual, start, jac=partial(_jacobian, stack, free, evidence, rows=rows),
        bounds=(free.low, free.high), loss="soft_l1", x_scale=free.typical, max_nfev=EVALUATIONS,
        xtol=1e-4, ftol=1e-5,
    )  # fmt: skip
    p[free.places] = result.x
    return stack.with_p(p), float(result.cost)


def score(stack: Stack, free: Free, evidence: Evidence) -> Scored:
    """Held-out deviations of a stack whose free numbers are at their optimum, to first order."""
    values = stack.p[free.places]
    e = evidence.residual(stack.model, stack.p)
    span = free.high - free.low
    inside = (values - free.low > 1e-6 * span) & (free.high - values > 1e-6 * span)
    inside |= ~np.isfinite(span)
    kept = Free(*(column[inside] for column in free))
    columns = _jacobian(stack, kept, evidence, values[inside]) * kept.typical
    return Scored(stack, evidence.deviations(_left_out(columns, e, evidence)), free=free)


def _left_out(
    columns: Float64[np.ndarray, "r k"], e: Float64[np.ndarray, "m ny"], evidence: Evidence
) -> Float64[np.ndarray, "m ny"]:
    """What the residuals would be had their fold not been fitted."""
    ny = e.shape[1]
    fold = np.repeat(evidence.fold, ny)
    flat = e.ravel()
    weight = 1.0 / np.sqrt(1.0 + flat**2)
    grams, sides, places = [], [], []
    for number in range(int(fold.max()) + 1):
        inside = fold == number
        weighted = columns[inside] * weight[inside, None]
        grams.append(columns[inside].T @ weighted)
        sides.append(weighted.T @ flat[inside])
        places.append(inside)
    gram, side = sum(grams), sum(sides)
    out = flat.copy()
    for part, own, inside in zip(grams, sides, places, strict=True):
        step = -np.linalg.lstsq(gram - part, side - own, rcond=1e-9)[0]
        out[inside] = flat[inside] + columns[inside] @ step
    return out.reshape(e.shape)


def _fit_grid(stack: Stack, at: int, own: GridTerm, evidence: Evidence) -> Scored:
    """A grid: solved at once, for each prior; the best on held-out folds whose numbers lie within
    their ends: beyond them rows are met by what no machine does to its input."""
    part = stack.parts[at]
    first = stack.first(at)
    n = len(part.values)
    p, model = stack.p, stack.model
    free = Free(
        first + np.arange(n), np.array(part.low), np.array(part.high), np.array(part.typical)
    )
    e = evidence.residual(model, p)
    columns = _touched(stack, part, own, free, evidence)
    found: list[tuple[Prior, Scored]] = []
    for prior in own.priors(part.term):
        mixed = columns @ prior.modes
        spread = float((mixed**2).sum(axis=1).mean())
        if spread <= 0.0:
            continue
        mixed /= np.sqrt(spread)
        for noise, values, out in _ridges(mixed, e, prior.noises, evidence):
            q = p.copy()
            q[free.places] += prior.modes @ values / np.sqrt(spread)
            if (q[free.places] < free.low).any() or (q[free.places] > free.high).any():
                continue
            name = f"{prior.name}, noise {noise:g}"
            scored = Scored(stack.with_p(q), evidence.deviations(out), name)
            found.append((prior._replace(noises=(noise,)), scored))
    return _simplest(found) if found else Scored(stack, evidence.deviations(e), "no effect")


def _simplest(found: Sequence[tuple[Prior, Scored]]) -> Scored:
    """The best prior; a less symmetric one must pay, and of near equals the smoothest wins."""
    best: Scored | None = None
    for rank in sorted({prior.rank for prior, _ in found}):
        rivals = [(prior, scored) for prior, scored in found if prior.rank == rank]
        least = min(scored.mean for _, scored in rivals)
        near = [pair for pair in rivals if pair[1].mean <= (1 + NEAR) * least]
        chosen = max(near, key=lambda pair: (pair[0].length, pair[0].noises[0]))[1]
        if best is None or chosen.mean < (1 - PAYS) * best.mean:
            best = chosen
    assert best is not None
    return best


def _touched(
    stack: Stack, part: Part, own: GridTerm, free: Free, evidence: Evidence
) -> Float64[np.ndarray, "r k"]:
    """The Jacobian, simulated only for numbers that the recorded inputs reach."""
    names, term = stack.base.inputs.names, part.term
    u = _as_seen(stack, part, evidence.u)[:, names.index(term.channel)]
    source = evidence.u[:, names.index(term.source)] if term.source else None
    some = np.flatnonzero(own.reached(term, u, source).any(axis=0))
    chosen = Free(*(column[some] for column in free))
    columns = np.zeros((evidence.known.size, len(free.places)))
    columns[:, some] = _jacobian(stack, chosen, evidence, stack.p[chosen.places])
    return columns


def _as_seen(stack: Stack, part: Part, u: Inputs) -> Inputs:
    """The inputs as the terms before this one leave them, where they depend on the row alone."""
    inner = Stack(stack.base, stack.inner)
    for other in stack.parts:
        if other.term == part.term or other.kind.rank > 0:
            break
        inner = inner.with_part(other)[0]
    return effective_inputs(inner.model, u, inner.p)


def _ridges(
    columns: Float64[np.ndarray, "r k"],
    e: Float64[np.ndarray, "m ny"],
    noises: Sequence[float],
    evidence: Evidence,
) -> Iterator[tuple[float, Vector, Float64[np.ndarray, "m ny"]]]:
    """(noise, numbers, held-out residuals), from one eigendecomposition per fold.

    The robust weights come from a first fit with the middle noise.
    """
    fold, flat = np.repeat(evidence.fold, e.shape[1]), e.ravel()
    middle = sorted(noises)[len(noises) // 2] * np.eye(columns.shape[1])
    first = flat - columns @ np.linalg.solve(columns.T @ columns + middle, columns.T @ flat)
    weighted = columns / np.sqrt(1.0 + first**2)[:, None]
    gram, side = columns.T @ weighted, weighted.T @ flat
    whole = np.linalg.eigh(gram)
    parts = []
    for number in range(int(fold.max()) + 1):
        own = fold == number
        share = weighted[own]
        parts.append((own, np.linalg.eigh(gram - columns[own].T @ share), share.T @ flat[own]))
    for noise in noises:
        out = flat.copy()
        for own, system, known in parts:
            out[own] += columns[own] @ _eigen_solve(system, noise, side - known)
        yield noise, _eigen_solve(whole, noise, side), out.reshape(e.shape)


def _eigen_solve(system: tuple[Any, Any], noise: float, side: Vector) -> Vector:
    """−(A + noise·1)⁻¹·side of a symmetric A given by its eigenvalues and eigenvectors."""
    values, vectors = system
    return np.asarray(-(vectors @ ((vectors.T @ side) / (np.maximum(values, 0.0) + noise))))
