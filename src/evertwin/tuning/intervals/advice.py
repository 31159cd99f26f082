"""What would make a parameter identifiable: extra motion.

`advise` tries simple changes of each input on the model itself (the other direction, smaller and
larger values, any value where it is constant) and names those that raise the information most,
until every direction is determined. Where no motion helps, the parameters cannot be told apart at
all and it says so.

>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> axis = FunctionModel(lambda x, u, dt, p: ([], [p[0] * np.sign(u[0]) + p[1]]),
...     Layout.of(speed="rad/s"), Layout.of(torque="Nm"),
...     parameters=Parameters.of(Fc=(1.0, "Nm"), offset=(0.1, "Nm")))
>>> advise(axis, ("Fc", "offset"), np.linspace(1, 2, 20)[:, None], np.full(20, 0.05))
('speed in both directions (here 1 to 2 rad/s)',)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evertwin.models import Model
from evertwin.tuning.intervals.identifiability import NULL, SHARE, SMALL
from evertwin.types import Inputs, Vector

ROWS, STRETCH = 100, 400
"""Rows that the changes are tried on: of a map any, of a model with states those in a row."""
HUGE = 1e100
"""What no output is by any motion."""
MOST = 3
"""Changes named at most."""


class _Acting:
    """How the outputs of a model hang on its parameters, each asked of it once."""

    def __init__(self, model: Model, seen: Inputs, dt: Vector) -> None:
        self.model, self.seen, self.dt = model, seen, dt
        self.columns: dict[tuple[str, str], Any] = {}

    @classmethod
    def of(cls, model: Model, seen: Inputs, dt: Vector) -> _Acting:
        """Kept with the model: asked again and again, as one hypothesis follows the other."""
        known = getattr(model, "__dict__", {}).setdefault("_acting", {})
        if (key := seen.tobytes() + dt.tobytes()) not in known:
            known.clear()
            known[key] = cls(model, seen, dt)
        found: _Acting = known[key]
        return found

    def at(self, text: str, u: Inputs, names: Sequence[str]) -> Any:
        """Sensitivity to the named parameters in natural sizes on these inputs, (n·ny, k)."""
        for name in names:
            if (text, name) not in self.columns:
                self.columns[text, name] = _sensitivity(self.model, name, u, self.dt)
        return np.stack([self.columns[text, name] for name in names], axis=1)


def advise(
    model: Model, names: Sequence[str], u: Inputs, dt: Vector, wider: float = 2.0,
    least: float = NULL,
) -> tuple[str, ...]:  # fmt: skip
    """The extra motion that would determine ``names``, in words; empty if nothing helps.

    Args:
        model: any model; simulated freely from its initial state.
        names: parameters that the rows do not determine, with those they are entangled with.
        u: inputs seen, (n, nu).
        dt: from the row before to each [s], (n,).
        wider: how far beyond the values seen a larger one may lie.
        least: singular value of unit columns from which a direction is determined.
    """
    whole = np.isfinite(u).all(axis=1)
    known = u[whole]
    if not len(known):
        return ()
    some = slice(STRETCH) if len(model.states) else slice(None, None, max(1, len(u) // ROWS))
    seen, ends = known[some], (known.min(axis=0), known.max(axis=0))
    acting = _Acting.of(model, seen, np.ascontiguousarray(dt[whole][some]))
    rows = acting.at("", seen, names)
    said: list[str] = []
    tried = {text: acting.at(text, v, names) for text, v in _changes(model, seen, ends, wider)}
    options = {text: columns for text, columns in tried.items() if np.isfinite(columns).all()}
    if not np.isfinite(rows).all():
        return ()
    for _ in range(MOST):
        if _determined(rows, least) or not options:
            break
        best = max(options, key=lambda text: _score(rows, options[text]))
        gained = np.concatenate([rows, options.pop(best)])
        if _score(gained) < _score(rows) + 0.5:
            break
        rows = gained
        said.append(best)
    return tuple(said) if _determined(rows, least) else ()


def _changes(
    model: Model, u: Inputs, ends: tuple[Vector, Vector], wider: float
) -> Iterator[tuple[str, Inputs]]:
    """Changed inputs, each with its description; ``ends``: between which the inputs lay."""
    for c, channel in enumerate(model.inputs):
        low, high = float(ends[0][c]), float(ends[1][c])
        here = f"(here {low:.3g} to {high:.3g} {channel.unit})"
        other = u.copy()
        if low == high:
            reach = min(max(abs(low), 1.0), channel.high)
            other[:, c] = np.where(np.arange(len(u)) % 2, 1.0, -1.0) * reach
            yield f"a changing {channel.name} (here constant {low:.3g} {channel.unit})", other
        else:
            if low >= 0 or high <= 0:
                other[:, c] = np.clip(-u[:, c], channel.low, channel.high)
                yield f"{channel.name} in both directions {here}", other
            wide = u.copy()
            factor = np.where(np.arange(len(u)) % 2, 0.3, wider)
            wide[:, c] = np.clip(factor * u[:, c], channel.low, channel.high)
            much = "wider" if wider <= 2.0 else "much wider"
            yield f"{channel.name} over a {much} range {here}", wide
        if low == high != 0.0:
            both = u.copy()
            both[:, c] *= np.linspace(-2.0, 2.0, len(u))
            yield f"{channel.name} at several values in both directions {here}", both


def _sensitivity(model: Model, name: str, u: Inputs, dt: Vector) -> Any:
    """Outputs' sensitivity to a parameter in its natural size, (n·ny,): none where the model has no
    answer, NaN where it runs away."""
    p = model.parameters.values
    place = model.parameters.index(name)
    size = abs(float(p[place])) or 1.0
    ends = []
    for sign in (-1.0, 1.0):
        q = p.copy()
        q[place] += sign * 1e-4 * size
        ends.append(model.simulate(model.initial(q), u, dt, q)[1].ravel())
    found = (ends[1] - ends[0]) / 2e-4
    return np.where(np.abs(found) > HUGE, np.nan, np.where(np.isnan(found), 0.0, found))


def _unit(rows: Any) -> Any:
    length = np.sqrt(np.square(rows).sum(axis=0))
    return rows / np.where(length > 0, length, 1.0)


def _score(*rows: Any) -> float:
    """Log-determinant of the unit columns' information, floored where undetermined."""
    products = sum(one.T @ one for one in rows)
    length = np.sqrt(products.diagonal())
    length = np.where(length > 0, length, 1.0)
    values = np.linalg.eigvalsh(products / np.outer(length, length))
    return float(np.log(np.maximum(values, 1e-8)).sum())


def _determined(rows: Any, least: float) -> bool:
    """The gate's rule on directions."""
    unit = _unit(rows)
    values, vectors = np.linalg.eigh(unit.T @ unit)
    if values[0] < least**2:
        return False
    for value, vector in zip(values, vectors.T, strict=True):
        z2 = np.square(unit @ vector)
        active = np.count_nonzero(np.abs(unit).sum(axis=1))
        if value < SMALL**2 and z2.sum() ** 2 / np.square(z2).sum() / active < SHARE:
            return False
    return True
