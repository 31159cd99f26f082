"""The laws of a friction term, as a public checker.

>>> from evertwin.machines.friction.registry import term
>>> check_friction(term("stribeck"))
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from evertwin.compiled.memory import behind
from evertwin.errors import LawBroken
from evertwin.machines.friction.contract import Coefficient, FrictionTerm
from evertwin.machines.friction.kernel import FEATURE, SLOPE, columns_of, feature, slope
from evertwin.machines.friction.law import Law
from evertwin.types import Int64, Vector

WIDTHS = (0.02, 0.5)
"""Of the switch [rad/s]."""
TOP = 5.0
"""Speeds are looked at up to here [rad/s]."""
LOADS, TEMPERATURES, PLACES = (-30.0, 7.0), (290.0, 320.0), (-1.0, 2.0)


def check_friction(term: FrictionTerm) -> None:
    """Checks the laws of a friction term.

    Laws: *finite* (every feature is a finite number, at rest too, with NaN in what the term does
    not read); *compiled* (feature and slope bound agree with their compiled forms to 1e-12);
    *slope* (under a smooth switch no feature is steeper than its bound); *resists* (the feature of
    a coefficient that resists has the sign of the speed).

    Raises:
        LawBroken: names the law, the coefficient and the figures.
        UsageError: a function cannot be compiled.
    """
    shape = np.array([item.value for item in term.shape] or [0.0])
    law = Law("tanh", (term,))
    for one, column in zip(term.coefficients, columns_of(law, 0), strict=True):
        _same(one, column, term, shape)
        _finite_and_bounded(one, term, shape)


def _given(term: FrictionTerm) -> Iterator[tuple[float, float, float]]:
    """Load, temperature and position; NaN where the term does not read them."""
    ranges = {"load": LOADS, "T": TEMPERATURES, "q": PLACES}
    load, T, q = (v if name in term.reads else (math.nan,) for name, v in ranges.items())
    return itertools.product(load, T, q)


def _speeds() -> Vector:
    fine = np.linspace(-1.0, 1.0, 2001)
    return np.unique(np.concatenate([fine * TOP, fine * WIDTHS[0], [0.0]]).round(9))


def _same(
    one: Coefficient, column: Int64[np.ndarray, " 4"], term: FrictionTerm, shape: Vector
) -> None:
    k = behind(shape, 0)
    for (load, T, q), width, v in itertools.product(_given(term), WIDTHS, (-1.3, 0.0, 0.01, 2.0)):
        s = math.tanh(v / width)
        pairs = {
            "feature": (
                one.feature(v, s, load, T, q, shape),
                feature(int(column[FEATURE]), v, s, load, T, q, k),
            ),
            "slope": (
                one.slope(width, load, T, shape),
                slope(int(column[SLOPE]), width, load, T, k),
            ),
        }
        for what, (plain, compiled) in pairs.items():
            if not abs(plain - compiled) <= 1e-12 * max(1.0, abs(plain)):
                raise LawBroken(
                    f"finite, compiled: the {what} of {one.name} is {plain} in Python and "
                    f"{compiled} compiled, at v = {v:g}, load = {load:g}, T = {T:g}, q = {q:g}: "
                    f"say in reads what it depends on"
                )


def _finite_and_bounded(one: Coefficient, term: FrictionTerm, shape: Vector) -> None:
    speeds = _speeds()
    for (load, T, q), width in itertools.product(_given(term), WIDTHS):
        s = np.tanh(speeds / width)
        f = np.array([
            one.feature(v, x, load, T, q, shape)
            for v, x in zip(speeds.tolist(), s.tolist(), strict=True)
        ])  # fmt: skip
        if not np.isfinite(f).all():
            v = speeds[~np.isfinite(f)][0]
            raise LawBroken(f"finite: the feature of {one.name} is no number at v = {v:g}")
        if one.resists and (f * speeds < 0.0).any():
            v = speeds[f * speeds < 0.0][0]
            raise LawBroken(f"resists: the feature of {one.name} pushes on at v = {v:g}")
        steep, bound = np.abs(np.diff(f) / np.diff(speeds)), one.slope(width, load, T, shape)
        if not steep.max() <= bound * (1.0 + 1e-9) + 1e-9:
            v = speeds[int(steep.argmax())]
            raise LawBroken(
                f"slope: {one.name} rises by {steep.max():.4g} at v = {v:.4g} under a switch of "
                f"width {width:g}, its bound is {bound:.4g}"
            )
