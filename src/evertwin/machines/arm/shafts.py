"""Shafts that turn with several axes: a coupled wrist's motor, or its joint, rubs as well.

    v = row · q̇        τ += row · (Ia·v̇ + Fv·v + Fc·s(v))

Where torques are the joints', a motor that drives two of them is a shaft that turns with their sum
(motor-side friction); where they are the motors', a joint that follows two motors is one
(joint-side friction beside the motors' own). The switch ``s`` is that of the last axis in the row.

>>> shaft = Shaft.of({"m6": [0, 0, 0, 0, 1, 1]}, 6)[0]
>>> [item.name for item in shaft.parameters()], shaft.axis
(['Ia_m6', 'Fv_m6', 'Fc_m6'], 5)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.machines.friction import Rung
from evertwin.machines.friction.resisting import Rubbed
from evertwin.models import Parameter, Parameters
from evertwin.types import Float64, Inputs, Int64, ParameterVector

NUMBERS = 3
"""Ia, Fv, Fc of each."""


class Shaft(NamedTuple):
    """One shaft. See the module."""

    name: str
    row: tuple[float, ...]
    """How far it turns with each axis."""

    @classmethod
    def of(cls, given: Mapping[str, Sequence[float]], n: int) -> tuple[Shaft, ...]:
        """Shafts from their rows.

        Raises:
            UsageError: a row has another length than there are axes, or fewer than two of them.
        """
        made = tuple(cls(name, tuple(map(float, row))) for name, row in given.items())
        for name, row in made:
            if len(row) != n or np.count_nonzero(row) < 2 or not name.isidentifier():
                raise UsageError(
                    f"shafts: {name}: expected a name such as 'm6' and {n} numbers, two or more of "
                    f"them not 0 (a shaft that follows one axis has its friction), got {row}"
                )
        return made

    @property
    def axis(self) -> int:
        """The last axis that turns it."""
        return int(np.flatnonzero(self.row)[-1])

    def parameters(self) -> tuple[Parameter, ...]:
        """Its inertia and friction."""
        return (
            Parameter(f"Ia_{self.name}", 0.0, "kgm2"),
            Parameter(f"Fv_{self.name}", 0.0, "Nms/rad", resists=True),
            Parameter(f"Fc_{self.name}", 0.0, "Nm", resists=True),
        )

    @property
    def rung(self) -> Rung:
        """It joins as a whole, where it pays on its last axis."""
        names = tuple(item.name for item in self.parameters())
        return Rung("shaft", names, self.axis, f"{self.name} rubs too, and turns with several axes")

    def columns(self, u: Inputs, width: float, standstill: float) -> Float64[np.ndarray, "n ny 3"]:
        """What its numbers are multiplied with, on every axis."""
        q = u.reshape(len(u), 3, -1) @ np.array(self.row)
        v = q[:, 1]
        s = np.tanh(v / width) if width > 0.0 else np.sign(v) * (np.abs(v) > standstill)
        own = np.stack([q[:, 2], v, s], axis=1)
        return np.asarray(np.array(self.row)[None, :, None] * own[:, None, :])

    def rubbed(self, u: Inputs, p: Parameters, values: ParameterVector) -> Rubbed:
        """Its friction at rows of motion; ``p``: names of ``values``."""
        names, tanh = self.rung.add[1:], f"width{self.axis + 1}"
        wide = float(values[p.index(tanh)]) if tanh in p.names else 0.0
        own = self.columns(u, wide, 0.0)[:, self.axis] / self.row[self.axis]
        force = own[:, 1:] @ values[p.indices(names)]
        speed = u.reshape(len(u), 3, -1)[:, 1] @ np.array(self.row)
        return Rubbed(f"shaft {self.name}", names, ("rad/s", "Nm"), speed, force)


def columns(
    shafts: Sequence[Shaft], u: Inputs, p: ParameterVector, widths: Int64[np.ndarray, " ny"],
    standstill: Float64[np.ndarray, " ny"],
) -> list[Float64[np.ndarray, "n ny 3"]]:  # fmt: skip
    """The columns of all shafts; ``widths``: places in ``p`` of the axes' switches, −1: a sign."""
    found = []
    for one in shafts:
        place = widths[one.axis]
        width = float(p[place]) if place >= 0 else 0.0
        found.append(one.columns(u, width, float(standstill[one.axis])))
    return found


def column_places(
    shafts: Sequence[Shaft], first: int, code: int, output: int
) -> list[tuple[int, int, int, int]]:
    """(place in p, code, 0, 0) of the shafts' columns that act on an output."""
    return [
        (first + NUMBERS * k + i, code + NUMBERS * k + i, 0, 0)
        for k, shaft in enumerate(shafts)
        if shaft.row[output]
        for i in range(NUMBERS)
    ]
