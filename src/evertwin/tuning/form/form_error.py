"""Intervals that carry the error of the form: what a number is, should another one change.

An interval from the residual's scatter assumes that the form is right. Where it is not, a number
makes up for what the form lacks, and more rows make it more certain of the wrong value. So the
residual of a static map is asked whether a coefficient changes with an input (or in time), on the
rows that no input's noise decides (`evertwin.tuning.form.noisy_inputs`): column times shape
(`evertwin.tuning.residuals.shapes`), greedily, each accepted only where it pays for having been
chosen among all. If none is, the form stands and so do the intervals.

What is accepted is only *like* the truth. The fit is then taken again with all shapes of the
accepted kinds beside the tuned parameters, each with a prior of `LIKE` of what was found, and what
they take from a parameter is marginalised out (Kennedy and O'Hagan 2001, on a dictionary). The
interval says where the number lies if the form may be wrong in this way. It need not hold the value
that predicts best in the wrong form; then the reason says so, and the number is weak.

>>> from evertwin.fold import make_block
>>> from evertwin.machines.drive import DriveForce
>>> from evertwin.tuning import solve
>>> rng, t = np.random.default_rng(0), np.arange(4000) * 0.01
>>> v = np.sin(0.7 * t) * np.sin(0.13 * t)
>>> a = np.gradient(v, t)
>>> force = 2.0 * a + 5.0 * np.sign(v) + 4.0 * np.sign(v) * np.abs(v) ** 0.6
>>> y = (force + rng.normal(0.0, 0.2, 4000))[:, None]
>>> rows = make_block(t=(t * 1e9).astype(np.int64), u=np.stack([v, a], axis=1), y=y)
>>> problem = Problem(DriveForce(), (rows,), ("mass", "Fv", "Fc"))
>>> plain = solve(problem)
>>> told = carried(problem, plain)
>>> [low < 5.0 < high for low, high in (plain.interval("Fc"), told.interval("Fc"))]
[False, True]
>>> told.reasons[2].split(";")[0]
'the form of force does not hold (Fc by speed)'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.tuning.form.form_rows import Asked, Basis, Columns, Shaped, Term, Widths, scaled
from evertwin.tuning.form.noisy_inputs import hang
from evertwin.tuning.intervals.assemble import sizes_of, student
from evertwin.tuning.intervals.fit import Amend, Fit
from evertwin.tuning.intervals.identifiability import grade
from evertwin.tuning.linear.sensitivity import Sensitivity
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.residuals.autocorrelation import Correlation, Series
from evertwin.types import Float64, Vector

LIKE = 0.3
"""How far a shape that was found may be from the true one, as a part of what it explains."""
TERMS = 6
"""Shapes that are accepted at most, for one output."""
INPUTS = 4
"""Inputs that are looked at closely."""
FEW = 50
"""Rows below which nothing is asked."""
ROWS, COARSE, CELLS = 4000, 800, 4_000_000
"""Rows that shapes are chosen on; that inputs are chosen on; rows times shapes at most."""
OWN = 1e-4
"""Part of a shape that the columns do not have, squared, from which it counts."""
FAR = 0.05
"""Part of a number's size that its value may lie beside its interval's middle, and be told all the
same."""
SAID = 2
"""Terms that are named, the ones that explain most."""
TIME = "time"
WRONG = "the form of {} does not hold ({})"
NOISY = "{0} is off ({1}) only where noise of the inputs decides it: its form or that noise"


class _Marginal(NamedTuple):
    """What an output tells of its parameters once the shapes have taken theirs."""

    information: Float64[np.ndarray, "m m"]
    side: Widths
    rows: float
    """Effective rows beyond what is paid for."""


def carried(problem: Problem, fit: Fit) -> Fit:
    """The fit with intervals that hold where the form does not. Values stay.

    Args:
        problem: what was tuned; of a model with states the fit comes back as it is.
        fit: its outcome.
    """
    free = np.array([verdict != "not" for verdict in fit.verdict])
    if len(problem.model.states) or not free.any() or not fit.converged:
        return fit
    acting = problem.sensitivity(fit.values)
    if not acting.finite:
        return fit
    every = np.ones(len(fit.outputs), dtype=np.bool_)
    outputs, found, noisy = _wrong(problem, fit, acting, free, every)
    if noisy:
        fit = fit.amended({k: Amend(why=(why,)) for k, why in noisy.items()})
    if not any(found):
        return fit
    k = len(fit.names)
    information = np.diag(problem.information)
    side, rows = problem.information * (problem.start - fit.values), np.full(k, np.inf)
    for one, terms in zip(outputs, found, strict=True):
        if not len(one.r) or not len(one.at):
            continue
        told = _marginal(one, terms)
        information[np.ix_(one.at, one.at)] += told.information
        side[one.at] += told.side
        rows[one.at] = np.minimum(rows[one.at], told.rows)
    inverse = _inverted(information[np.ix_(free, free)])
    centre, half = fit.values.copy(), np.full(k, np.inf)
    centre[free] += inverse @ side[free]
    half[free] = student(rows[free]) * np.sqrt(np.maximum(inverse.diagonal(), 0.0))
    sizes = sizes_of(problem, acting, fit.values)
    return _told(fit, _said(fit, outputs, found), centre, half, sizes)


def wrong_outputs(problem: Problem, fit: Fit, asked: np.ndarray) -> np.ndarray:
    """Places of the ``asked`` outputs (ny,) whose residual tells that a coefficient changes with
    an input."""
    acting, free = problem.sensitivity(fit.values), np.ones(len(fit.names), dtype=np.bool_)
    _, found, _ = _wrong(problem, fit, acting, free, asked)
    return np.flatnonzero([bool(terms) for terms in found])


def _wrong(
    problem: Problem, fit: Fit, acting: Sensitivity, free: np.ndarray, asked: np.ndarray
) -> tuple[list[Asked], list[list[Term]], dict[int, str]]:
    """Every output's rows, and the terms that pay there on rows that no noise of an input decides;
    and what is said of those that pay with such rows alone. None of outputs that are not asked."""
    out = np.broadcast_to(~asked, problem.rows.y.shape)
    outputs, every = _asked(problem, fit, acting, free, out)
    # where no term pays it need not be known which rows these are
    noisy = hang(problem, fit.values) if any(every) else np.zeros_like(out)
    if not noisy.any():
        return outputs, every, {}
    kept, again = _asked(problem, fit, acting, free, out | noisy)
    found = [still if terms else [] for terms, still in zip(every, again, strict=True)]
    only = [[] if still else terms for terms, still in zip(every, found, strict=True)]
    return kept, found, _said(fit, outputs, only, NOISY)


def _asked(
    problem: Problem, fit: Fit, acting: Sensitivity, free: np.ndarray, without: np.ndarray
) -> tuple[list[Asked], list[list[Term]]]:
    """Every output's rows, those `without` left out, and the terms that pay there."""
    residuals, shared = problem.residuals(fit.values), dict[bytes, Mapping[str, Shaped]]()
    outputs = list[Asked]()
    for o, r in enumerate(residuals.T):
        columns, at = acting.of(o)
        acts = free[at] & acting.acts[o][at]
        known = _known(problem, o, r) & ~without[:, o]
        if known.tobytes() not in shared:
            shared[known.tobytes()] = _inputs(problem, known)
        inputs = shared[known.tobytes()]
        outputs.append(Asked(columns[known][:, acts], at[acts], r[known], inputs))
    return outputs, [_chosen(one) for one in outputs]


def _known(problem: Problem, output: int, r: Series) -> np.ndarray:
    rows = problem.rows
    return np.asarray(rows.used[:, output] & np.isfinite(r) & np.isfinite(rows.u).all(axis=1))


def _inputs(problem: Problem, known: np.ndarray) -> Mapping[str, Shaped]:
    rows = problem.rows
    inputs = {TIME: Shaped(np.cumsum(rows.dt)[known])}
    for name, u in zip(problem.model.inputs.names, rows.u.T, strict=True):
        # a machine's place is the sum of its speed, whether or not the model takes it
        way = Shaped(np.nancumsum(u * rows.dt)[known])
        inputs |= {name: Shaped(u[known]), f"the sum of {name}": way}
    return inputs


def _chosen(one: Asked) -> list[Term]:
    """The terms that pay for having been chosen among all."""
    if len(one.r) < FEW or not len(one.at) or not np.any(one.r):
        return []
    near = one.thinned(COARSE)
    if len(one.inputs) > INPUTS:
        basis = near.basis
        r = near.r - basis @ (basis.T @ near.r)
        both = _products(basis, near.columns)
        best = {name: _best(near, of, both, r) for name, of in near.inputs.items()}
        one = one.only(sorted(best, key=lambda name: -best[name])[:INPUTS])
    count = len(near.at) * sum(len(near.inputs[name].shapes[0]) for name in one.inputs)
    if not count:
        return []
    one = one.thinned(min(ROWS, max(CELLS // count, COARSE)))
    terms, columns = one.candidates()
    left, r = _apart(one, one.basis, columns)
    border = 2.0 * np.log(len(terms)) + np.log(len(r))
    accepted = list[Term]()
    for _ in range(TERMS):
        gains, length = _gains(left, r)
        b = int(np.argmax(gains))
        unit = left[:, b] / np.sqrt(length[b]) if length[b] > 0 else left[:, b]
        after = r - unit * (unit @ r)
        noise = float(after @ after) / len(r) * _memory(after)
        if not gains[b] > border * noise:
            break
        accepted.append(terms[b])
        left, r = left - np.outer(unit, unit @ left), after
    return accepted


def _products(basis: Basis, columns: Columns) -> Float64[np.ndarray, "n products"]:
    """Every column of the basis times every other one."""
    return np.asarray((basis[:, :, None] * columns[:, None, :]).reshape(len(columns), -1))


def _best(
    one: Asked, of: Shaped, both: Float64[np.ndarray, "n products"], r: Series
) -> float:  # fmt: skip
    """The most that one shape of an input explains of ``r``, which the columns have left. As
    `_gains` of its `candidates` says it, without a copy of each; ``both``: `_products`."""
    columns, values = one.columns, of.shapes[1]
    squares = np.square(columns).T @ np.square(values)
    side = (columns * r[:, None]).T @ values
    m, s = columns.shape[1], values.shape[1]
    across = (both.T @ values).reshape(both.shape[1] // m, m, s)
    left = squares - np.square(across).sum(axis=0)
    explains = left > OWN * squares
    return float(
        np.where(explains, np.square(side) / np.where(explains, left, 1.0), 0.0).max(initial=0.0)
    )


def _apart(one: Asked, basis: Basis, columns: Columns) -> tuple[Columns, Series]:
    """What the output's own columns leave of others, and of the residual."""
    return columns - basis @ (basis.T @ columns), one.r - basis @ (basis.T @ one.r)


def _gains(left: Columns, r: Series) -> tuple[Widths, Widths]:
    """(what each column explains of the squares of r, the columns' squared lengths)."""
    length = np.square(left).sum(axis=0)
    own = length > OWN
    gains = np.where(own, np.square(left.T @ r) / np.where(own, length, 1.0), 0.0)
    return gains, length


def _memory(r: Series) -> float:
    """How many rows count as one for the mean of a slow column: 1 + 2 Σ ρ, at least 1."""
    (rho,) = Correlation.of(r[:, None]).memory
    return max(1.0 + 2.0 * float(rho[1:].sum()), 1.0)


def _marginal(one: Asked, terms: Sequence[Term]) -> _Marginal:
    """Information and side of the output's parameters; the shapes' share taken out."""
    own, size = scaled(one.columns)
    extra, prior, paid = np.empty((len(one.r), 0)), np.empty(0), own.shape[1] + len(terms)
    r = one.r
    if terms:
        every, columns = one.only(list(dict.fromkeys(t.input for t in terms))).candidates()
        taken = [every.index(term) for term in terms]
        both = np.concatenate([own, columns[:, taken]], axis=1)
        theta = np.linalg.lstsq(both, one.r, rcond=1e-10)[0]
        r = one.r - both @ theta
        found = dict[tuple[int, str, str], np.ndarray]()
        for term, column, by in zip(
            terms, columns[:, taken].T, theta[own.shape[1] :].tolist(), strict=True
        ):
            kind = (term.column, term.input, term.kind)
            found[kind] = found.get(kind, np.zeros(len(r))) + by * column
        amount = {kind: float(np.linalg.norm(column)) for kind, column in found.items()}
        like = [j for j, t in enumerate(every) if (t.column, t.input, t.kind) in found]
        like = taken + [j for j in like if j not in taken]
        extra = columns[:, like]
        kinds = [(every[j].column, every[j].input, every[j].kind) for j in like]
        prior = np.array([1.0 / (LIKE * amount[kind]) ** 2 for kind in kinds])
        prior[: len(taken)] = 0.0
    memory = _memory(r)
    noise = max(float(r @ r) / max(len(r) - paid, 1), 1e-300) * memory
    middle = extra.T @ extra / noise + np.diag(prior)
    across = own.T @ extra / noise
    lost = across @ _inverted(middle)
    information = own.T @ own / noise - lost @ across.T
    side = own.T @ one.r / noise - lost @ (extra.T @ one.r / noise)
    rows = max(len(r) / memory - paid, 1.0)
    return _Marginal(information * size[:, None] * size, side * size, rows)


def _inverted(matrix: Float64[np.ndarray, "k k"]) -> Float64[np.ndarray, "k k"]:
    """Inverse of a matrix without negative directions, whatever the units."""
    size = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    size[size == 0] = 1.0
    unit = matrix / np.outer(size, size)
    return np.asarray(scipy.linalg.pinvh(unit, rtol=1e-12) / np.outer(size, size))


def _said(
    fit: Fit, outputs: Sequence[Asked], found: Sequence[Sequence[Term]], words: str = WRONG
) -> dict[int, str]:
    """Which parameters act on an output whose form is wrong, and what is said of it."""
    said: dict[int, str] = {}
    for one, terms, name in zip(outputs, found, fit.outputs, strict=True):
        parts = [f"{fit.names[one.at[t.column]]} by {t.input}" for t in terms]
        if parts:
            changes = ", ".join(list(dict.fromkeys(parts))[:SAID])
            for k in one.at.tolist():
                said.setdefault(k, words.format(name, changes))
    return said


def _told(fit: Fit, said: Mapping[int, str], centre: Vector, half: Vector, sizes: Vector) -> Fit:
    """The fit with the intervals of the parameters that something is said of."""
    found = dict[int, Amend]()
    for k, why in said.items():
        low, high = float(centre[k] - half[k]), float(centre[k] + half[k])
        value = float(fit.values[k])
        off = not low <= value <= high
        if off:  # both ways tell it, and neither is known to be the wrong one
            low, high = min(low, fit.interval95[k, 0]), max(high, fit.interval95[k, 1])
        (word,), (wide,) = grade([""], np.array([high - low]) / (2.0 * sizes[k]))
        if off:
            wide = (
                f"with that left free {centre[k]:.4g} ± {half[k]:.2g}; {value:.4g} only predicts "
                "best in this form"
            )
        elif low <= 0.0 <= high:
            wide = "not told from zero"
        far = off and abs(value - float(centre[k])) > FAR * sizes[k]
        sure = word == "identifiable" and not far and not low <= 0.0 <= high
        found[k] = Amend((low, high), "" if sure else "weak", (why, wide))
    return fit.amended(found)
