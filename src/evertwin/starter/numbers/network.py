"""What a recording says, roughly, of stores that several inputs fill and that act on each other.

Of each output the change over a piece of time is told by the means of its terms over that piece:
what inputs fill, what it loses of itself, what goes over between it and what is of its kind, and
how far an input opens that way. A term is taken where it tells of pieces that it was not fitted to.

>>> rng, t = np.random.default_rng(0), np.arange(4000.0)
>>> heat, sun = (np.repeat(rng.uniform(0.0, 1.0, 80), 50) for _ in range(2))
>>> import scipy
>>> y = scipy.signal.lfilter([0.0, 1.0], [1.0, -0.98], 0.3 * heat + 0.1 * sun)
>>> kinds = {"heat": (heat, "1"), "sun": (sun, "1"), "y": (y, "m")}
>>> signals = {k: Signal(k, unit, one) for k, (one, unit) in kinds.items()}
>>> found = network_of(t, signals, ["heat", "sun"], ["y"])
>>> by = {term.of: round(term.value, 1) for term in found.equations["y"] if term.kind == "by"}
>>> by[("heat",)], by[("sun",)]
(0.3, 0.1)
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from evertwin.types import Float64, Vector

PIECES = 2000
"""Pieces of a recording that are looked at, at most."""
CLEAR = 10.0
"""So many times its scatter an output moves in a piece, in the usual spread of its changes."""
GAIN, MOST = 0.05, 9
"""Share of what is left, squared, that a term takes of pieces it was not fitted to; and terms of
an output."""
TOLD = 0.2
"""Share of an output's changes that is told, at least, for it to be one."""
FOLLOWS = 0.6
"""The same of an output that its inputs put where it is."""
FREE = ("by", "times")
"""Kinds of term that may push either way."""
FOLDS = 6
"""Runs of pieces, dealt out in turn."""
SLIDES = 0.02
"""Share of its fastest over which what rubs turns round."""


@dataclass(frozen=True)
class Signal:
    """A column.

    >>> Signal("level", "m", np.zeros(2)).warm
    False
    """

    name: str
    unit: str
    """That its column is in."""
    values: Vector
    """In SI, (n,)."""
    warm: bool = False
    """Is it a temperature?"""
    speed: bool = False


class Term(NamedTuple):
    """One number of an output's equation.

    >>> Term("y_leak", "leak", (), 0.1).value
    0.1
    """

    name: str
    kind: str
    """``constant``, ``by``, ``times``, ``leak``, ``to``, ``opens``, ``drains``, ``pours``,
    ``rubs`` or ``drags``."""
    of: tuple[str, ...]
    """Columns, the input that opens a way before where it leads to."""
    value: float
    follows: bool = False
    """Is it the leak of an output that its inputs put where it is?"""


class Network(NamedTuple):
    """Columns, and the terms of each output's rate of change.

    >>> Network({}, {}, {}).inputs
    {}
    """

    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    equations: Mapping[str, tuple[Term, ...]]

    @property
    def apart(self) -> bool:
        """Has each of several outputs inputs of its own, and nothing to do with the others?"""
        used = [{column for term in told for column in term.of} for told in self.equations.values()]
        every = set().union(*used)
        shared = sum(map(len, used)) > len(every) or not every.isdisjoint(self.outputs)
        return len(used) > 1 and not shared

    @property
    def followed(self) -> frozenset[str]:
        """Inputs that put an output where it is within a row or two."""
        return frozenset(
            column
            for told in self.equations.values() if told[-1].follows
            for term in told for column in term.of
        )  # fmt: skip


def network_of(
    t: Vector, signals: Mapping[str, Signal], inputs: Sequence[str], outputs: Sequence[str],
    *, fixed: bool = False,
) -> Network | None:  # fmt: skip
    """The equations of what answers.

    Args:
        t: time of each row [s], (n,), rising.
        signals: by column.
        inputs: columns that drive.
        outputs: columns that could answer; one that is not told, but tells another one, drives.
        fixed: has a person said which is which?
    """
    drives, could = list(inputs), list(outputs)
    found = {name: _equation(t, signals, name, drives, could) for name in could}
    if not fixed:
        # a temperature of which nothing tells is of what is around
        poor = [name for name in could if found[name][1] < TOLD]
        could = [name for name in could if name not in poor]
        drives += [name for name in poor if signals[name].warm]
        found = {name: _equation(t, signals, name, drives, could) for name in could}
    equations = {name: told for name, (told, _) in found.items() if len(told) > 1 or fixed}
    used = {column for told in equations.values() for term in told for column in term.of}
    kept = [name for name in drives if name in used or (fixed and name in inputs)]
    if not kept or not equations or used - set(kept) - equations.keys():
        return None
    return Network({n: signals[n] for n in kept}, {n: signals[n] for n in equations}, equations)


def _equation(
    t: Vector, signals: Mapping[str, Signal], name: str, inputs: Collection[str],
    outputs: Collection[str],
) -> tuple[tuple[Term, ...], float]:  # fmt: skip
    """The terms of an output with their values, and the share of its changes that they tell."""
    own = signals[name]
    finite = np.isfinite(t)
    for column in (name, *inputs, *outputs):
        finite &= np.isfinite(signals[column].values)
    if np.count_nonzero(finite) < 10 * FOLDS:
        return (), 0.0
    clock, y = t[finite], own.values[finite]
    rows = _rows(y)
    edges = np.unique(np.linspace(0, len(y) - 1, min(PIECES, (len(y) - 1) // rows) + 1).astype(int))
    ends = np.minimum(edges[:-1] + rows, len(y) - 1)
    seconds = clock[ends] - clock[edges[:-1]]
    right = y[ends] - y[edges[:-1]]
    usual = float(np.median(np.diff(clock)))
    good = (seconds > 0.0) & (seconds < 5.0 * rows * usual)

    def over(values: Vector) -> Float64[np.ndarray, " pieces"]:
        """The integral over each piece."""
        sums = np.append(0.0, np.cumsum(0.5 * (values[:-1] + values[1:]) * np.diff(clock)))
        return np.asarray(sums[ends] - sums[edges[:-1]])

    columns = {
        key: over(_acts(key, signals, name)[finite])[good]
        for key in _kinds(signals, name, inputs, outputs)
    }
    found = _chosen(name, columns, right[good], seconds[good], signals)
    if found[1] >= TOLD:
        return found
    level = {key: _acts(key, signals, name)[finite] for key in _levels(signals, inputs)}
    return _follows(name, level, y, usual, signals)


Key: TypeAlias = tuple[str, tuple[str, ...]]
Piece: TypeAlias = Float64[np.ndarray, " pieces"]


def _kinds(
    signals: Mapping[str, Signal], name: str, inputs: Collection[str], outputs: Collection[str]
) -> Iterator[Key]:
    """Terms that an output may have."""
    own = signals[name]
    alike = [c for c in (*inputs, *outputs) if c != name and own.warm and signals[c].warm]
    pours = not (own.warm or own.speed) and own.values.min(initial=0.0) >= -SLIDES * np.ptp(
        own.values
    )
    yield "leak", ()
    if pours:
        yield "pours", ()
    for column in (*inputs, *outputs):
        if column != name:
            yield ("to" if column in alike else "by"), (column,)
    opening = [c for c in inputs if c not in alike and signals[c].values.min(initial=0.0) >= 0.0]
    for column in opening:
        yield from (("opens", (column, other)) for other in alike)
        if not own.warm:
            yield "drains", (column,)
        if pours:
            yield "pours", (column,)
    if own.warm:  # a current heats whichever way it flows
        signed = [c for c in inputs if signals[c].values.min(initial=0.0) < 0.0]
        yield from (("times", (column, column)) for column in signed)
    if own.speed:
        yield "rubs", ()
        yield "drags", ()


def _levels(signals: Mapping[str, Signal], inputs: Collection[str]) -> Iterator[Key]:
    """Terms that an output may follow without delay."""
    yield from (("by", (column,)) for column in inputs)
    plain = [column for column in inputs if not signals[column].warm]
    yield from (("times", pair) for pair in itertools.combinations(plain, 2))


def _follows(
    name: str, columns: Mapping[Key, Vector], y: Vector, usual: float, signals: Mapping[str, Signal]
) -> tuple[tuple[Term, ...], float]:
    """Of an output that is where its inputs put it within a row or two."""
    some = slice(None, None, max(len(y) // PIECES, 1))
    ones = np.ones(len(y[some]))
    found = {key: one[some] for key, one in columns.items()}
    terms, share = _chosen(name, found, y[some], ones, signals)
    if share < FOLLOWS:
        return (), 0.0
    rate = 1.0 / usual
    own = Term(f"{signals[name].name}_leak", "leak", (), rate, follows=True)
    return (*(one._replace(value=rate * one.value) for one in terms), own), share


def _acts(key: Key, signals: Mapping[str, Signal], name: str) -> Vector:
    """A term's part of the rate of change where its number is 1, (n,)."""
    kind, of = key
    y, others = signals[name].values, [signals[c].values for c in of]
    own: dict[str, Callable[[], Vector]] = {
        "leak": lambda: y, "drains": lambda: y, "rubs": lambda: np.tanh(y / slides(y)),
        "drags": lambda: np.abs(y) * y, "pours": lambda: np.sqrt(np.maximum(y, 0.0)),
    }  # fmt: skip
    if kind in own:
        return np.asarray(-np.prod([own[kind](), *others], axis=0))
    if kind in ("to", "opens"):
        others = [*others[:-1], others[-1] - y]
    return np.asarray(np.prod(others, axis=0))


def slides(y: Vector) -> float:
    """How fast what rubs turns round."""
    return float(f"{SLIDES * np.nanmax(np.abs(y)) + 1e-12:.1g}")


def _rows(y: Vector) -> int:
    """Rows of a piece: an output moves in it by far more than its scatter."""
    scatter = float(np.median(np.abs(np.diff(y, 2)))) / (0.6745 * 6**0.5)
    rows = 1
    while rows < len(y) // (20 * FOLDS) and np.std(y[rows:] - y[:-rows]) < CLEAR * scatter:
        rows *= 2
    return rows


def _chosen(
    name: str, columns: Mapping[Key, Piece], right: Piece, seconds: Piece,
    signals: Mapping[str, Signal],
) -> tuple[tuple[Term, ...], float]:  # fmt: skip
    """Terms one after the other, each the one that tells most of pieces it was not fitted to."""
    fold = np.arange(len(right)) * 5 * FOLDS // max(len(right), 1) % FOLDS
    taken: list[Key] = []
    first = left = _left([seconds], right, fold)
    if not left > 0.0:
        return (), 0.0
    moving = [key for key, one in columns.items() if float(np.ptp(one)) > 0.0]
    while len(taken) < MOST:
        best: tuple[Key, ...] = ()
        for together in (1, 2):  # what flows in shows beside what flows out alone
            rest = itertools.combinations([key for key in moving if key not in taken], together)
            tried = {
                more: _left([seconds, *(columns[key] for key in (*taken, *more))], right, fold)
                for more in rest if _sound([*taken, *more], columns, right, seconds)
            }  # fmt: skip
            best = min(tried, key=lambda more: tried[more], default=())
            if best and tried[best] <= (1.0 - together * GAIN) * left:
                break
            best = ()
        if not best:
            break
        taken, left = [*taken, *best], tried[best]
    values = _solved([seconds, *(columns[key] for key in taken)], right)
    own = signals[name].name
    terms = [Term(f"{own}_constant", "constant", (), float(values[0]))]
    for (kind, of), value in zip(taken, values[1:], strict=True):
        said = "_".join([own, kind, *(signals[c].name for c in of)])
        terms.append(Term(said, kind, of, float(value)))
    return tuple(terms), 1.0 - left / first


def _sound(
    taken: Sequence[Key], columns: Mapping[Key, Piece], right: Piece, seconds: Piece
) -> bool:
    """Does nothing flow from what is less to what is more?"""
    values = _solved([seconds, *(columns[key] for key in taken)], right)[1:]
    return all(v > 0.0 for (kind, _), v in zip(taken, values, strict=True) if kind not in FREE)


def _solved(columns: Sequence[Piece], right: Piece) -> Float64[np.ndarray, " terms"]:
    table = np.column_stack(columns)
    scale = np.linalg.norm(table, axis=0) + 1e-300
    return np.asarray(np.linalg.lstsq(table / scale, right, rcond=1e-10)[0] / scale)


def _left(columns: Sequence[Piece], right: Piece, fold: np.ndarray) -> float:
    """Mean square that is left of each fold by a fit to the others."""
    table = np.column_stack(columns)
    table = table / (np.linalg.norm(table, axis=0) + 1e-300)
    parts = [(table[fold == k], right[fold == k]) for k in range(FOLDS)]
    squares = np.array([a.T @ a for a, _ in parts])
    sides = np.array([a.T @ b for a, b in parts])
    out = 0.0
    for (a, b), square, side in zip(parts, squares, sides, strict=True):
        whole = squares.sum(axis=0) - square
        values = np.linalg.lstsq(whole, sides.sum(axis=0) - side, rcond=1e-12)[0]
        out += float(np.square(b - a @ values).sum())
    return out / max(len(right), 1)
