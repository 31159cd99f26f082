"""The bank: the same data under many hypotheses at once, each in closed form.

Under one hypothesis a value is

    y_k = z_k·θ + b·G_k + W_k + v_k,    v ~ N(0, s²·ω_k),    Var W(G) = s²·q·G

with columns z (a constant, shifts, covariates), the clock G of `clocks`, a
Wiener process W that runs on the clock, and noise v. A scalar Kalman filter over W whitens all
columns alike; what remains is least squares. With flat θ, b and log s the posterior of (θ, b) is a
Student distribution and the probability of the data is

    log p(y) = −½ Σ log F_k − ½ log |X'X| − ½ν·log(π·S) + log Γ(½ν),    ν = n − p

the product of the predictive likelihoods of each value given those before it. The sums X'X grow by
one row per value: nothing is kept but them. q = 0 is a path with noise, q → ∞ a Wiener process
without.

Sources: Zellner, "An Introduction to Bayesian Inference in Econometrics" (1971), ch. 3; de Jong,
"The diffuse Kalman filter" (1991): the same filter over all columns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from evertwin.types import Float64

RIDGE = 1e-4
"""Weight, in values, of the prior that holds the effects of covariates near 0."""
FLOOR = 1e-14
"""Least residual variance, in squares of the distance to the limit."""


class Posterior(NamedTuple):
    """What the data say under each of h hypotheses, in units of the scaled problem.

    >>> Posterior._fields[0]
    'evidence'
    """

    evidence: Float64[np.ndarray, " h"]
    """log p(y) with flat priors."""
    level: Float64[np.ndarray, " h"]
    """Mean of the level without growth, a."""
    now: Float64[np.ndarray, " h"]
    """Mean of the level now, a + b + W."""
    growth: Float64[np.ndarray, " h"]
    """Mean of b."""
    cov: Float64[np.ndarray, "h 3"]
    """Var(level now), Cov(level now, b), Var(b), over s²."""
    square: Float64[np.ndarray, " h"]
    """S: the sum of squares of what is new; s² = S/χ²_ν."""
    dof: float
    """ν."""

    def take(self, index: np.ndarray) -> Posterior:
        """Some of the hypotheses."""
        return Posterior(
            self.evidence[index], self.level[index], self.now[index], self.growth[index],
            self.cov[index], self.square[index], self.dof,
        )  # fmt: skip


class Sums(NamedTuple):
    """What least squares need of h hypotheses, each with p columns.

    >>> Sums._fields
    ('gram', 'logs', 'carried', 'left')
    """

    gram: Float64[np.ndarray, "h p p"]
    """X'X, y as last column."""
    logs: Float64[np.ndarray, " h"]
    """Σ log F."""
    carried: Float64[np.ndarray, "h p"]
    """W's filtered part of each column."""
    left: Float64[np.ndarray, " h"]
    """Its variance."""


def filtered(
    y: Float64[np.ndarray, " n"], omega: Float64[np.ndarray, " n"],
    fixed: Float64[np.ndarray, "n k"], clock: Float64[np.ndarray, "h n"],
    q: Float64[np.ndarray, " h"],
) -> Sums:  # fmt: skip
    """Sums with a process: value after value, all hypotheses at once."""
    h, (n, k) = len(q), fixed.shape
    rows = np.empty((n, k + 2, h))
    rows[:, :k], rows[:, k], rows[:, -1] = fixed[:, :, None], clock.T, y[:, None]
    added = q * np.maximum(np.diff(clock, axis=1, prepend=clock[:, :1]), 0.0).T
    whole, carried, variance = np.empty((n, h)), np.zeros((k + 2, h)), np.zeros(h)
    for new, more, f, noise in zip(rows, added, whole, omega.tolist(), strict=True):
        variance += more
        np.add(variance, noise, out=f)
        gain = variance / f
        new -= carried
        carried += gain * new
        np.multiply(gain, noise, out=variance)
    rows /= np.sqrt(whole)[:, None, :]
    rows = rows.transpose(2, 1, 0)
    gram = np.matmul(rows, rows.transpose(0, 2, 1))
    return Sums(gram, np.log(whole).sum(axis=0), carried.T, variance)


def sums(
    y: Float64[np.ndarray, " n"], omega: Float64[np.ndarray, " n"],
    fixed: Float64[np.ndarray, "n k"], clock: Float64[np.ndarray, "h n"],
) -> Sums:  # fmt: skip
    """Sums without a process: nothing is carried from value to value."""
    weight = 1.0 / np.sqrt(omega)
    rows = np.empty((len(clock), fixed.shape[1] + 2, len(y)))
    rows[:, :-2], rows[:, -2], rows[:, -1] = (fixed * weight[:, None]).T, clock * weight, y * weight
    gram = np.matmul(rows, rows.transpose(0, 2, 1))
    h, p = gram.shape[:2]
    return Sums(gram, np.full(h, np.log(omega).sum()), np.zeros((h, p)), np.zeros(h))


def evaluate(
    y: Float64[np.ndarray, " n"], omega: Float64[np.ndarray, " n"],
    fixed: Float64[np.ndarray, "n k"], clock: Float64[np.ndarray, "h n"],
    q: Float64[np.ndarray, " h"], base: Float64[np.ndarray, " k"],
) -> Posterior:  # fmt: skip
    """The posterior under each hypothesis.

    Args:
        y: values, scaled so that the distance to the limit is about 1.
        omega: variance of each value's noise, relative.
        fixed: columns: constant first, then shifts and covariates.
        clock: G at each value, per hypothesis.
        q: variance of W over G = 1 in units of the noise, per hypothesis.
        base: the fixed columns under which the limit holds.
    """
    (n, k), h = fixed.shape, len(q)
    found = filtered(y, omega, fixed, clock, q) if q.any() else sums(y, omega, fixed, clock)
    gram, logs, state, left = found
    inverse, beta, square, evidence = solved(gram, logs, n, k)
    # The level now is base·θ + b·G(now) + W, and W's filtered mean is what the filter carries.
    weight = np.concatenate([np.tile(base, (h, 1)), np.ones((h, 1))], axis=1) - state[:, :-1]
    now = state[:, -1] + np.einsum("hi,hi->h", weight, beta)
    across = np.einsum("hij,hj->hi", inverse, weight)
    cov = np.stack(
        [np.einsum("hi,hi->h", weight, across) + left, across[:, -1], inverse[:, -1, -1]], axis=1
    )
    dof = float(max(n - k - 1, 1))
    return Posterior(evidence, beta[:, :-1] @ base, now, beta[:, -1], cov, square, dof)


def without_growth(
    y: Float64[np.ndarray, " n"], omega: Float64[np.ndarray, " n"],
    fixed: Float64[np.ndarray, "n k"],
) -> float:  # fmt: skip
    """log p(y) of a level with noise and nothing else."""
    n, k = fixed.shape
    gram, logs, _, _ = sums(y, omega, fixed, np.zeros((1, n)))
    keep = np.r_[:k, k + 1]
    return float(solved(gram[:, keep][:, :, keep], logs, n, k)[-1][0])


def solved(
    gram: Float64[np.ndarray, "h p p"], logs: Float64[np.ndarray, " h"], n: int, k: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """((X'X)⁻¹, θ and b, S, log evidence) of n values with k fixed columns."""
    p = gram.shape[1] - 1
    a, c = gram[:, :-1, :-1].copy(), gram[:, :-1, -1]
    ridge = np.zeros(p)
    ridge[1:k] = RIDGE
    largest = np.einsum("hii->hi", a).max(axis=1, keepdims=True)
    a[:, np.arange(p), np.arange(p)] += ridge + 1e-12 * np.maximum(largest, 1e-12)
    inverse = np.linalg.inv(a)
    beta = np.einsum("hij,hj->hi", inverse, c)
    dof = float(max(n - p, 1))
    square = np.maximum(gram[:, -1, -1] - np.einsum("hi,hi->h", beta, c), FLOOR * dof)
    evidence = (
        -0.5 * logs
        - 0.5 * np.linalg.slogdet(a)[1]
        - 0.5 * dof * np.log(np.pi * square)
        + scipy.special.gammaln(0.5 * dof)
    )
    return inverse, beta, square, evidence
