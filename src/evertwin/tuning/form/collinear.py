"""Of parameters that act alike on the rows one is kept: the simpler.

Only a combination of collinear parameters is told, so the gate refuses them all, and a fit that
puts all of them back predicts no better than before. Here one of them after the other stays as it
was, from the last on: what starts at zero may stay out, and a law names its simple terms first.
What is kept then makes up for the others, and the reasons say so: of each number that would be
another one if what is held were. Its interval holds what it would be with none of that, or twice as
much, to first order; what is held at zero is an effect that is left out.

Where the form is wrong, *nearly* collinear parameters (`NEAR`) are no better told: each takes up
what the form lacks, large against the other. A right form tells them by the part that differs.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> law = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0] + p[1] * 2.0 * u[0]]),
...     Layout.of(z="m"), Layout.of(force="N"),
...     parameters=Parameters.of(a=(1.0, "1"), b=(0.0, "1")))
>>> z = np.linspace(-1.0, 1.0, 60)[:, None]
>>> noise = np.random.default_rng(0).normal(0.0, 0.01, (60, 1))
>>> problem = Problem(law, (make_block(t=np.arange(60), u=z, y=3.0 * z + noise),))
>>> solve(problem).verdict, told_apart(problem, solve(problem)).verdict
(('not', 'not'), ('identifiable', 'not'))
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evertwin.models.corrected.corrected import Corrected
from evertwin.tuning.form.form_error import wrong_outputs
from evertwin.tuning.form.omitted import normal, shifted
from evertwin.tuning.intervals.advice import advise
from evertwin.tuning.intervals.fit import Fit
from evertwin.tuning.intervals.identifiability import NULL, WEAK, grade
from evertwin.tuning.linear.sensitivity import Spectrum
from evertwin.tuning.posing.problem import Problem
from evertwin.tuning.posing.recordings import beginning
from evertwin.tuning.search.minima import lowest
from evertwin.tuning.solver import solve

NEAR = 1.0 / 30.0
"""Part of a column that the simpler ones do not have, below which a wrong form decides about it:
the inverse of the condition index from which collinearity harms (Belsley, Kuh, Welsch 1980)."""
ZERO = "not told from zero"
FAR = 20.0
"""How far beyond the values seen a motion is looked for that tells them."""


class Alike(NamedTuple):
    """A parameter that stays, since a simpler one acts like it.

    >>> Alike("b", "a", 0.0).beside
    'a'
    """

    name: str
    beside: str
    part: float
    """Of its effect, what the simpler ones do not have."""


def told_apart(problem: Problem, fit: Fit) -> Fit:
    """The fit with one of each group of collinear parameters. Of models with a state only where
    nothing is told otherwise, as where a force's and a mass's scale are all there is: what a
    recording began with tells no scale; a correction takes its place by rules of its own."""
    if fit.names != problem.names or not fit.converged:
        return fit
    begins = beginning(problem.model, fit.names)
    words = {w for n, w in zip(fit.names, fit.verdict, strict=True) if n not in begins}
    told = words != {"not"} or isinstance(problem.model, Corrected)
    if len(problem.model.states) and told:
        return fit
    whole, found, stays = problem, fit, dict[str, Alike]()
    while len(found.names) > 1:
        alike = _alike(problem, found)
        if not alike:
            break
        stays |= {one.name: one for one in alike}
        problem = problem.tuning(tuple(n for n in found.names if n not in stays))
        if problem.settings.begin:  # found together with what stays
            problem = lowest(problem)
        found = solve(problem)
    return _leaning(whole, _whole(problem, fit, found, stays), stays) if stays else fit


def _alike(problem: Problem, fit: Fit) -> list[Alike]:
    """Parameters of a map that simpler ones act like altogether; else the least simple one that
    acts nearly so."""
    acting = problem.sensitivity(fit.values)
    if not acting.finite:
        return []
    begins = np.isin(fit.names, beginning(problem.model, fit.names))  # held, they bend the rest
    order = np.lexsort((np.arange(len(fit.names)), problem.start == 0, ~begins))
    told = _parts(Spectrum.of(acting.information(fit.noise)), order)
    dynamic = len(problem.model.states) > 0
    word = "collinear: only" if dynamic else "collinear"
    refused = np.array([one.startswith(word) if dynamic else word in one for one in fit.reasons])
    near = np.array([0.0 < part < NEAR for part, _ in told]) & ~refused
    if not (dynamic or refused.any() or problem.settings.quick) and near.any():
        wrong = wrong_outputs(problem, fit, np.asarray(acting.acts[:, near].any(axis=1)))
        refused = near & acting.acts[wrong].any(axis=0)
    mine = [k for k in order.tolist() if refused[k] and told[k][1] >= 0]
    same = [k for k in mine if told[k][0] < NULL and not dynamic] or mine[-1:]
    return [Alike(fit.names[k], fit.names[told[k][1]], told[k][0]) for k in same]


def _parts(spectrum: Spectrum, order: np.ndarray) -> list[tuple[float, int]]:
    """(what the columns before it in the ``order`` leave of each, the most like it; −1: none)."""
    vectors = spectrum.vectors * np.sqrt(spectrum.squares)
    found = [(1.0, -1)] * len(order)
    for place, k in enumerate(order.tolist()):
        before = order[:place]
        if not place or not spectrum.length[k] > 0:
            continue
        by = np.linalg.lstsq(vectors[before].T, vectors[k], rcond=1e-12)[0]
        left = float(np.linalg.norm(vectors[k] - by @ vectors[before]))
        like = np.abs(vectors[before] @ vectors[k])
        found[k] = (left, int(before[int(np.argmax(like))]))
    return found


def _whole(problem: Problem, fit: Fit, found: Fit, stays: Mapping[str, Alike]) -> Fit:
    """The fit of all parameters: those that stay, as they were."""
    at = np.array([fit.names.index(name) for name in found.names])
    k = len(fit.names)
    values, interval = fit.start.copy(), np.tile([-np.inf, np.inf], (k, 1))
    sigma, covariance = np.full(k, np.inf), np.zeros((k, k))
    np.fill_diagonal(covariance, np.inf)
    values[at], interval[at], sigma[at] = found.values, found.interval95, found.sigma
    covariance[np.ix_(at, at)] = found.covariance
    verdict, reasons = ["not"] * k, [""] * k
    for j, place in enumerate(at.tolist()):
        verdict[place], reasons[place] = found.verdict[j], found.reasons[j]
    for name, alike in stays.items():
        place, needs = (
            fit.names.index(name),
            "" if problem.settings.quick else _needs(problem, alike),
        )
        reasons[place] = (
            f"collinear: on these rows {alike.beside} acts like it (all but {100 * alike.part:.2g} "
            f"%), so it stays as it was; {needs}"
        )
        _note(reasons, fit, alike.beside, name)
    return replace(
        found, names=fit.names, units=fit.units, values=values, start=fit.start, sigma=sigma,
        interval95=interval, covariance=covariance, verdict=tuple(verdict),
        reasons=tuple(reasons),
        message=f"{found.message}; {', '.join(stays)} as before: others act alike",
    )  # fmt: skip


def _note(reasons: list[str], fit: Fit, kept: str, held: str) -> None:
    """Says of a number that it is told with one that is held."""
    at, said = fit.names.index(kept), f"told with {held} = {fit.start[fit.names.index(held)]:g}"
    if said not in reasons[at].split("; "):
        reasons[at] = "; ".join(filter(None, (reasons[at], said)))


def leaning_on(problem: Problem, fit: Fit, found: Fit, stays: tuple[str, ...]) -> Fit:
    """``found``, the fit of a problem without what ``stays`` as ``fit`` began, with what of its
    numbers hangs on that."""
    whole = _leaning(problem, _whole(problem, fit, found, {}), dict.fromkeys(stays))
    at = [whole.names.index(name) for name in found.names]
    return replace(
        found, interval95=whole.interval95[at], verdict=tuple(whole.verdict[k] for k in at),
        reasons=tuple(whole.reasons[k] for k in at),
    )  # fmt: skip


def _leaning(problem: Problem, fit: Fit, stays: Mapping[str, Alike | None]) -> Fit:
    """The fit, whose intervals carry how far its numbers would move with what is held; of a scale
    or a sum, of which no row tells a part, they tell none either."""
    products = normal(problem, fit)
    told = zip(fit.names, fit.verdict, strict=True)
    rest = np.flatnonzero([name not in stays and word != "not" for name, word in told])
    if products is None or not len(rest):
        return fit
    half, reasons, verdict = np.diff(fit.interval95)[:, 0] / 2.0, [*fit.reasons], [*fit.verdict]
    more, parts = np.zeros(len(half)), np.zeros(len(half), dtype=np.bool_)
    for name, alike in stays.items():
        at = fit.names.index(name)
        side = products[rest, at] * fit.start[at]
        by = np.abs(shifted(products[np.ix_(rest, rest)], side))
        for k in rest[by > half[rest]].tolist():
            _note(reasons, fit, fit.names[k], name)
        more[rest] += np.where(by > half[rest], by, 0.0)
        parts[rest] |= (by > half[rest]) & (alike is not None and alike.part < NULL)
    sizes = np.maximum(np.abs(fit.start), np.abs(fit.values))
    parts |= (more > 0.0) & (half + more > WEAK * sizes)
    more[half + more > WEAK * sizes] = 0.0  # told as a multiple of what is held
    interval = fit.interval95 + np.outer(more, (-1.0, 1.0))
    for k in np.flatnonzero(more).tolist():
        (verdict[k],), (why,) = grade([""], (half + more)[k : k + 1] / sizes[k])
        if half[k] + more[k] >= abs(fit.values[k]):
            verdict[k], why = "weak" if verdict[k] == "identifiable" else verdict[k], why or ZERO
        reasons[k] = "; ".join(filter(None, (reasons[k], why)))
    for k in np.flatnonzero(parts).tolist():
        verdict[k] = "weak"
        reasons[k] += ": only both together are told"
    return replace(fit, interval95=interval, verdict=tuple(verdict), reasons=tuple(reasons))


def _needs(problem: Problem, alike: Alike) -> str:
    dynamic = len(problem.model.states) > 0
    pair = (alike.beside, alike.name)  # a scale is of all of a model's
    own = problem.model.parameters.names
    if not set(pair) <= set(own):
        return "needs rows that begin at rest, or more of them"
    told = problem.model, own if dynamic else pair, problem.rows.u, problem.rows.dt
    needs = advise(*told, least=NEAR) or advise(*told, FAR, NEAR)
    return f"needs {' and '.join(needs)}" if needs else "no motion that was tried tells them apart"
