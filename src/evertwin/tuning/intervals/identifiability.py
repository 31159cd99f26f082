"""The gate before solving: which parameters do these rows determine?

Columns of the sensitivity are scaled to unit length, so that the question has no units. Then, for
the information matrix H = Σ Jᵀ J / σ²:

* a parameter whose column is zero is not excited here; one that changes the output nowhere is an
  error (*the knob is not connected*, `connected`);
* a direction whose singular value is (almost) zero is undetermined: every parameter in it is;
* a direction whose singular value is small **and** rests on less than 5 % of the rows is
  undetermined too; of a model with states, whose transients are few rows, only where these are
  predicted worse than others. That is the general rule behind a known trap: an offset together with
  direction-dependent Coulomb friction is separated only by the few rows near standstill, where the
  friction law is least known. It fits the training force better and simulates worse;
* the interval of the rest, against the parameter's natural size, tells identifiable from weak.

What is not identifiable keeps its prior. Condition index after Belsley, Kuh, Welsch, "Regression
Diagnostics" (1980); the share of rows is the participation ratio (Σz²)²/Σz⁴ of the direction.

>>> import numpy as np
>>> v = np.array([1.0, 2.0, 3.0, 1.5])
>>> j = np.stack([np.sign(v), v, np.ones(4)], axis=1)   # one direction of motion only
>>> acting = Sensitivity.dense(j[:, None], np.ones((4, 1), dtype=bool))
>>> result = gate(acting, np.ones(1), ("Fc", "Bm", "offset"), np.ones(3))
>>> result.undetermined, result.rank
((True, False, True), 2)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import ModelError
from evertwin.models import Model, Restart, kernel_of, roll
from evertwin.signals.spoken import MANY, MOST, share
from evertwin.tuning.linear.sensitivity import Sensitivity, Spectrum
from evertwin.types import (
    Float64,
    Inputs,
    Intervals,
    Outputs,
    ParameterVector,
    PerOutput,
    StateVector,
    Vector,
)

Matrix: TypeAlias = Float64[np.ndarray, "k k"]

NULL = 1e-3
"""Singular value of unit columns below which a direction is undetermined."""
SMALL = 0.25
"""… below which it must rest on more than a few rows."""
SHARE = 0.05
"""Share of the rows that it must rest on."""
LOADED = 0.2
"""Weight from which a parameter belongs to a direction."""
WEAK, NOT = 0.5, 2.0
"""Half width of the 95 % interval, in natural sizes, from which a parameter is weak or not
identifiable."""
LONGEST, STARTS = 20_000, 4
"""Rows and starts of the free runs that are asked whether a parameter moves anything."""


class Gate(NamedTuple):
    """What the rows determine.

    >>> Gate(("", "collinear"), 1, math.inf, Spectrum.of(np.eye(2))).undetermined
    (False, True)
    """

    reasons: tuple[str, ...]
    """Why a direction speaks against the parameter; empty where none does."""
    rank: int
    condition: float
    """Largest over smallest singular value of the unit columns."""
    spectrum: Spectrum
    """The information of what acts at all, by its directions."""

    @property
    def undetermined(self) -> tuple[bool, ...]:
        """Which parameters stay as they are."""
        return tuple(bool(reason) for reason in self.reasons)


def gate(
    acting: Sensitivity, sigma: PerOutput, names: tuple[str, ...], sizes: Vector,
    left: Outputs | None = None,
) -> Gate:  # fmt: skip
    """Judges each parameter.

    Args:
        acting: how the outputs change with the parameters, row by row.
        sigma: standard deviation of each output's noise, (ny,).
        names: the parameters.
        sizes: natural size of each, (k,); what counts as a large error.
        left: residual (n, ny) of a model with states. What tells its numbers are transients, which
            are few of its rows: they do, unless the form is worse there than elsewhere.
    """
    information, k = acting.information(sigma), len(names)
    spectrum = Spectrum.of(information)
    excitation = spectrum.length * sizes
    live = excitation > 1e-9 * max(float(excitation.max(initial=0.0)), 1e-300)
    refused, directions = [""] * k, spectrum.vectors
    if not live.all():
        refused = ["" if on else "not excited: it does not act in these rows" for on in live]
        spectrum = Spectrum.of(information[np.ix_(live, live)])
        directions = np.zeros((k, len(spectrum.squares)))
        directions[live] = spectrum.vectors
    values = np.sqrt(spectrum.squares).tolist()
    for i, value in enumerate(values):
        if value >= SMALL:
            break
        step = np.zeros(k)
        step[live] = directions[live, i] / spectrum.length
        share = acting.share(step, LOADED, sigma)
        few = share < SHARE and (left is None or not acting.believed(step, left, sigma))
        if value < NULL or few:
            _refuse(refused, directions[:, i], names, value, share)
    _nulls(refused, values, directions, names)
    # in rising order; without what does not act there is no smallest one
    condition = values[-1] / values[0] if len(values) == k and values[0] > 0 else math.inf
    rank = sum(value >= NULL for value in values)
    return Gate(tuple(refused), rank, condition, spectrum)


def _refuse(
    reasons: list[str], vector: Vector, names: tuple[str, ...], value: float, share: float
) -> None:
    """Notes every parameter that the undetermined direction loads."""
    loaded = np.flatnonzero(np.abs(vector) > LOADED * np.abs(vector).max())
    together = ", ".join(names[j] for j in loaded)
    for j in loaded.tolist():
        if value < NULL:
            reasons[j] = f"collinear: only a combination of {together} acts on these rows"
        else:
            reasons[j] = (
                f"nearly collinear: only {100 * share:.1f} % of the rows tell {together} apart"
            )


def _nulls(
    reasons: list[str], values: Sequence[float], vectors: Any, names: tuple[str, ...]
) -> None:
    """With several undetermined directions their basis is arbitrary: use the whole space."""
    count = sum(value < NULL for value in values)
    if count < 2:
        return
    null = vectors[:, :count]
    weight = np.sqrt(np.square(null).sum(axis=1))
    loaded = np.flatnonzero(weight > LOADED * weight.max())
    together = ", ".join(names[j] for j in loaded)
    for j in loaded.tolist():
        reasons[j] = f"collinear: only combinations of {together} act on these rows"


def grade(refused: Sequence[str], half: Vector) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(verdicts, reasons) of parameters from why they are refused, if so, and their intervals.

    Args:
        refused: why a direction speaks against the parameter; empty text where none does.
        half: half width of the 95 % interval in natural sizes, (k,).

    >>> grade(["", "", "collinear"], np.array([0.1, 0.7, 0.1]))[0]
    ('identifiable', 'weak', 'not')
    """
    verdicts, reasons = [], []
    for reason, width in zip(refused, half.tolist(), strict=True):
        if reason:
            word = "not"
        elif width <= WEAK:
            word = "identifiable"
        else:
            word = "weak" if width <= NOT else "not"
            reason = f"its 95 % interval is {within(width)}"
        verdicts.append(word)
        reasons.append(reason)
    return tuple(verdicts), tuple(reasons)


def within(width: float, of: str = "size") -> str:
    """Half the width of an interval in words, as a share.

    >>> within(0.51), within(13978566.0), within(math.nan)
    ('± 51 % of its size', 'more than a million times its size', 'unknown')
    """
    said = f"{100 * width:.0f} % of its {of}" if width < MANY else share(width)
    return f"± {said}" if width < MOST else said


def connected(model: Model, names: tuple[str, ...], u: Any, dt: Any = None) -> None:
    """Checks that each parameter changes the output somewhere: near the rows' inputs, or on the
    rows themselves, which reach what a short run does not (an overflow, a full tank).

    Args:
        model: any model.
        names: the parameters in question.
        u: inputs seen, (n, nu); probes reach beyond them.
        dt: intervals of these rows [s], (n,); None: only probes are tried.

    Raises:
        ModelError: the knob is not connected; names it.
    """
    silent = _silent(model, names, *_probes(u), ((1e-3, 0.5, -0.5), 1))
    if silent and dt is not None:
        rows = np.isfinite(u).all(axis=1)[:LONGEST]
        steps = np.asarray(dt)[:LONGEST][rows]
        sound = np.isfinite(steps) & (steps > 0.0)
        usual = float(np.median(steps[sound])) if sound.any() else 1.0
        own = u[:LONGEST][rows], np.where(sound, steps, usual)
        silent = _silent(model, silent, *own, ((1.0, -1.0, 10.0, -0.5), STARTS))
    for name in silent:
        raise ModelError(
            f"{name}: the knob is not connected: changing it changes no output; remove it from "
            "the editable parameters or check where the model uses it"
        )


def _silent(
    model: Model, names: Sequence[str], u: Any, dt: Any, tried: tuple[Sequence[float], int]
) -> tuple[str, ...]:
    """Parameters whose change changes no output of free runs over these rows.

    ``tried``: by how much each is changed, of its size, and from how many starts.
    """
    amounts, starts = tried
    p, silent = model.parameters.values, list(names)
    rng = np.random.default_rng(1)
    for start in range(starts):
        # where a state begins that nothing measures is a guess: others begin elsewhere
        factor = 2.0 ** rng.uniform(-3.0, 3.0, len(model.states)) if start else 1.0
        x = model.initial(p) * factor
        if not silent:
            break
        reference = _simulated(model, x, (u, dt), p)
        for name in tuple(silent):
            place = model.parameters.index(name)
            low, high = model.parameters.low[place], model.parameters.high[place]
            for amount in amounts:
                other = p.copy()
                step = amount * max(abs(p[place]), 1.0)
                other[place] = min(max(p[place] + step, low), high)
                y = _simulated(model, model.initial(other) * factor, (u, dt), other)
                if not np.array_equal(y, reference, equal_nan=True):
                    silent.remove(name)
                    break
    return tuple(silent)


def _simulated(
    model: Model, x: StateVector, rows: tuple[Inputs, Intervals], p: ParameterVector
) -> Outputs:
    """Outputs of a free run; NaN where the model has none."""
    try:
        return model.simulate(x, *rows, p)[1]
    except ModelError:  # its step raised something at a row
        return roll(kernel_of(model), x, *rows, p, Restart.never(len(rows[0]), len(model.outputs)))[
            1
        ]


def _probes(u: Any) -> tuple[Any, Any]:
    """Seeded inputs around and beyond those seen, and intervals."""
    rng = np.random.default_rng(0)
    size = np.nanmax(np.abs(np.where(np.isfinite(u), u, 0.0)), axis=0, initial=0.0)
    reach = np.where(size > 0, 1.5 * size, 1.0)
    return rng.uniform(-1.0, 1.0, (256, u.shape[1])) * reach, np.full(256, 0.05)
