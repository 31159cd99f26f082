"""Forecast: what the machine will do, open loop, each output with its band.

From the newest measured state the live version simulates the inputs to come. The band adds four
sources, each from where it is known:

* parameters: drawn from the intervals that their fits gave, simulated over the same inputs;
* start, process and sensor: how far open-loop runs over the recordings were off after the same
  lead time (`evertwin.ahead.spread`);
* inputs beyond the recorded ones: what they change, by how far beyond they are
  (`evertwin.ahead.planned.off_beyond`);
* how often: the shares that a band of so many σ held on the recordings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evertwin.ahead.basis import (
    Basis,
    Future,
    Mode,
    coming,
    draws,
    through,
)
from evertwin.ahead.planned import Planned, beyond, from_now, off_beyond
from evertwin.ahead.spread import BELL, spread
from evertwin.errors import UsageError
from evertwin.fold import Block, plain
from evertwin.rows.feed import Data
from evertwin.setup.newest import state_after
from evertwin.signals import wrap
from evertwin.signals.units import from_si
from evertwin.types import Inputs, Json, Outputs, Vector

DRAWS = 64
"""Parameter vectors that the band's share of the parameters is taken from."""
LARGEST = 20_000_000
"""Most numbers that are simulated at once."""
SHOWN = 10


@dataclass(frozen=True)
class ForecastOutput:
    """One output to come.

    >>> out = ForecastOutput("m", np.array([1.0]), np.array([0.1]), np.array([0.0]), (1.28, 1.96))
    >>> [end.round(3).tolist() for end in out.band(0.95)]
    [[0.804], [1.196]]
    """

    unit: str
    value: Vector
    """At each row, (n,)."""
    sigma_residual: Vector
    """Standard deviation by start, process, sensor and form, (n,)."""
    sigma_parameters: Vector
    """Standard deviation by the parameters' uncertainty, (n,)."""
    factor: tuple[float, float] = (1.2816, 1.96)
    """How many σ hold 80 % and 95 %."""
    angle: bool = False
    """Its band is a whole turn at most."""

    @property
    def sigma(self) -> Vector:
        """Both together, (n,)."""
        return np.asarray(np.hypot(self.sigma_residual, self.sigma_parameters))

    def band(self, level: float) -> tuple[Vector, Vector]:
        """Lower and upper end that hold ``level`` (0.8 or 0.95) of what will be measured."""
        half = self.factor[0 if level < 0.9 else 1] * self.sigma
        half = np.minimum(half, np.pi) if self.angle else half
        return self.value - half, self.value + half


@dataclass(frozen=True)
class Forecast:
    """The outcome of `Twin.forecast`.

    >>> Forecast("robot", 0, np.array([1.0]), {}, "hold", 9).horizon
    1.0
    """

    name: str
    version: int
    t: Vector
    """Time from now at each row [s]."""
    outputs: Mapping[str, ForecastOutput]
    mode: str
    """``repeat``, ``hold`` or ``planned``: where the inputs come from."""
    stretches: int
    """Open-loop stretches of recorded data that the band rests on."""
    learnt: float = np.inf
    """How long they are [s]; the band beyond is extrapolated."""
    recorded: Mapping[str, str] = field(default_factory=dict)
    """The unit in which an output is recorded, where it has one: text is in it, the rest in SI."""
    inputs: Inputs = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    notes: tuple[str, ...] = ()
    """What the values rest on that no recording shows."""

    def __repr__(self) -> str:
        told = f"{self.horizon:g} s ahead of {', '.join(self.outputs)}"
        return f"<Forecast of {self.name!r}, version {self.version}: {told}>"

    @property
    def horizon(self) -> float:
        """[s]"""
        return float(self.t[-1])

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.forecast/1"``."""
        outputs = {}
        for name, out in self.outputs.items():
            (low80, high80), (low95, high95) = out.band(0.8), out.band(0.95)
            outputs[name] = {
                "unit": out.unit, "value": out.value, "low80": low80, "high80": high80,
                "low95": low95, "high95": high95, "sigma_residual": out.sigma_residual,
                "sigma_parameters": out.sigma_parameters,
            }  # fmt: skip
        content: dict[str, Any] = {
            "schema": "evertwin.forecast/1", "name": self.name, "version": self.version,
            "horizon": self.horizon, "inputs": self.mode, "stretches": self.stretches,
            "learnt_over": self.learnt, "t": self.t, "outputs": outputs, "notes": self.notes,
        }  # fmt: skip
        return plain(content)  # type: ignore[return-value]

    def __str__(self) -> str:
        """A few rows of each output."""
        configured = " (as configured)" if self.version == 0 else ""
        lines = [
            f"{self.name}, version {self.version}{configured}: {self.horizon:g} s ahead, inputs: "
            f"{self.mode}; band from {self.stretches} open-loop stretches of {self.learnt:.3g} s"
        ]
        if self.horizon > self.learnt * 1.01:
            lines.append(
                f"beyond {self.learnt:.3g} s the band is extrapolated: longer recordings tell more"
            )
        lines += self.notes
        places = np.unique(np.linspace(0, len(self.t) - 1, min(SHOWN, len(self.t))).astype(int))
        for name, out in self.outputs.items():
            told = self.recorded.get(name) or out.unit
            lines.append(f"{name} [{told}]       value   80 %                     95 %")
            values, *bands = (
                np.asarray(from_si(one, told))
                for one in (out.value, *out.band(0.8), *out.band(0.95))
            )
            for i in places.tolist():
                ends = [float(end[i]) for end in bands]
                digits = _digits(ends[1] - ends[0])
                value, *said = (f"{x:.{digits}f}" for x in (float(values[i]), *ends))
                lines.append(
                    f"  {self.t[i]:8.4g} s {value:>11}   {said[0]:>10} … {said[1]:<10} "
                    f"{said[2]:>10} … {said[3]}"
                )
        return "\n".join(lines)


def _digits(width: float) -> int:
    """Decimals that show a band of this width with two digits or more."""
    if not (np.isfinite(width) and width > 0.0):
        return 4
    return min(max(1 - math.floor(math.log10(width)), 0), 12)


def forecast(
    basis: Basis, horizon: float, data: Data = None, mode: Mode = "repeat",
    inputs: Future | Planned | None = None,
) -> Forecast:  # fmt: skip
    """The live version's prediction from the end of recordings on.

    Args:
        basis: the twin's live version.
        horizon: how far [s].
        data: recordings up to now; None: the twin file's.
        mode: what the machine is told, where ``inputs`` does not say.
        inputs: planned inputs, or a file of them.

    Raises:
        UsageError: no horizon above zero, or one beyond the plan.
        DataError: no recordings, or too few to know how far predictions are off.
    """
    rows, model, p = basis.rows(data), basis.model, basis.p
    said: tuple[str, ...] = ()
    if isinstance(inputs, Planned):
        inputs, said = _begun(basis, inputs, rows[-1])
    future = coming(rows[-1], horizon, mode) if inputs is None else inputs
    known = spread(model, p, basis.alike(rows), float(future.t[-1]))
    y, by_p = _simulated(basis, rows[-1], future)
    start = [state_after(model, p, rows[-1])]
    off = off_beyond(
        basis, rows, future, lambda told: through(model, start, p[None], told.u, told.dt)[0]
    )
    sigma = np.hypot(known.sigma(future.t), off / BELL)
    outputs = {
        channel.name: ForecastOutput(
            channel.unit, y[:, k], sigma[:, k], by_p[:, k],
            (float(known.factor[k, 0]), float(known.factor[k, 1])), bool(model.outputs.angles[k]),
        )
        for k, channel in enumerate(model.outputs)
    }  # fmt: skip
    found = Forecast(
        basis.setup.spec.name, basis.champion, future.t, outputs, mode, known.stretches,
        known.length, basis.recorded, future.u,
    )  # fmt: skip
    if inputs is None:
        return found
    return replace(found, mode="planned", notes=(*said, *beyond(basis, rows, inputs)))


def _begun(basis: Basis, plan: Planned, newest: Block) -> tuple[Future, tuple[str, ...]]:
    """The rows of a plan from now on, as far as it is wanted; and what is to be said of them."""
    future, said = from_now(basis, plan.path, newest)
    if plan.until == math.inf:
        return future, said
    if not 0.0 < plan.until <= future.t[-1] * (1 + 1e-9):
        raise UsageError(
            f"horizon: expected above 0 s and at most {future.t[-1]:.6g} s, which {plan.path} "
            f"reaches, got {plan.until:.6g} s"
        )
    stop = int(np.searchsorted(future.t, plan.until * (1 - 1e-9))) + 1
    return Future(future.u[:stop], future.dt[:stop]), said


def _simulated(basis: Basis, newest: Block, future: Future) -> tuple[Outputs, Outputs]:
    """Outputs, and what the parameters leave open of them as standard deviations, (n, ny) each."""
    model, p = basis.model, basis.p
    y = through(model, [state_after(model, p, newest)], p[None], future.u, future.dt)[0]
    if not np.any(basis.sigma > 0.0):
        return y, np.zeros_like(y)
    drawn = draws(model, p, basis.sigma, DRAWS, seed=1)
    square, at_once = np.zeros_like(y), max(LARGEST // y.size, 1)
    for first in range(0, DRAWS, at_once):
        some = drawn[first : first + at_once]
        starts = [state_after(model, one, newest) for one in some]
        for one in through(model, starts, some, future.u, future.dt):
            square += wrap(one - y, model.outputs.angles) ** 2
    return y, np.sqrt(square / DRAWS)
