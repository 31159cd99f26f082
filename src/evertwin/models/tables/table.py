"""A table of measured data as a model: columns in, columns out, by interpolation.

For what was measured and has no formula: a pump's characteristic, a motor's efficiency over speed
and torque. One input column is interpolated between its values. Two and more have to form a grid
(every combination once, in any order) and are interpolated between its corners. Outside what was
measured there is nothing to go by, so the edge is held, or a straight line goes on, or the row is
an error, as chosen; `TableModel.outside` says how many rows were.

Each output has a gain and an offset, ``y = gain·table(u) + offset``: linear parameters, so that
tuning solves for them at once.

>>> pump = TableModel.of({"speed": [0.0, 100.0, 200.0]}, {"flow": [0.0, 2.0, 3.0]})
>>> rows = np.array([[50.0], [150.0], [250.0]])
>>> pump.simulate(np.zeros(0), rows, np.ones(3), pump.parameters.values)[1].ravel().tolist()
[1.0, 2.5, 3.0]
>>> pump.outside(rows)
{'speed': 1}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.models.compiled import StaticMap
from evertwin.models.parameters import Parameter, Parameters
from evertwin.signals.channels import Layout
from evertwin.types import Float64, Inputs, Int64, Intervals, Outputs, ParameterVector, StateVector

Beyond: TypeAlias = Literal["hold", "line", "error"]
"""Outside the measured range: the edge's value, a straight line on, or no value (NaN)."""


@dataclass(frozen=True, eq=False, repr=False)
class TableModel(StaticMap):
    """Interpolation in a table; static. See the module for an example, `TableModel.of` to build."""

    inputs: Layout
    outputs: Layout
    grid: tuple[np.ndarray, ...]
    """Rising values of each input, (levels,) each."""
    values: Float64[np.ndarray, "..."]
    """Outputs at the corners, (levels of input 1, levels of input 2, …, ny)."""
    beyond: Beyond = "hold"

    @classmethod
    def of(
        cls,
        inputs: Mapping[str, Any],
        outputs: Mapping[str, Any],
        units: Mapping[str, str] | None = None,
        beyond: str = "hold",
    ) -> TableModel:
        """A table from columns, each a sequence of numbers.

        Args:
            inputs: columns by name.
            outputs: columns by name.
            units: by name; a pure number where none is given.
            beyond: hold, line or error; see `Beyond`.

        Raises:
            DataError: columns differ in length, hold no number, or several inputs form no grid.
            UsageError: no input or no output, or an unknown way to go beyond.
        """
        if not inputs or not outputs:
            raise UsageError("table: expected at least one input column and one output column")
        if beyond not in ("hold", "line", "error"):
            raise UsageError(f"table: beyond: expected hold, line or error, got {beyond!r}")
        u, y = _columns(inputs), _columns(outputs)
        if len(u) != len(y):
            raise DataError(f"table: expected columns of one length, got {len(u)} and {len(y)}")
        known = np.isfinite(u).all(axis=1) & np.isfinite(y).all(axis=1)
        grid, values = _gridded(tuple(inputs), u[known], y[known])
        of = dict(units or {})
        layouts = [Layout.of(**{n: of.get(n, "1") for n in names}) for names in (inputs, outputs)]
        return cls(layouts[0], layouts[1], grid, values, beyond)  # type: ignore[arg-type]

    @cached_property
    def parameters(self) -> Parameters:
        """``gain.NAME`` and ``offset.NAME`` of each output."""
        items = []
        for channel in self.outputs:
            items.append(Parameter(f"gain.{channel.name}", 1.0, "1", source="as measured"))
            offset = Parameter(f"offset.{channel.name}", 0.0, channel.unit, source="as measured")
            items.append(offset)
        return Parameters(tuple(items))

    def simulate(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[StateVector, Outputs]:
        """The outputs of every row."""
        return np.array(x, dtype=np.float64), self.look_up(u) * p[0::2] + p[1::2]

    @property
    def columns(self) -> Int64[np.ndarray, "ny 2"]:
        """Gain and offset of each output."""
        return np.arange(2 * len(self.outputs), dtype=np.int64).reshape(-1, 2)

    def regressor(
        self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
    ) -> tuple[Outputs, Float64[np.ndarray, "n ny 2"]]:
        """Zeros; the table's value and one."""
        table = self.look_up(u)
        return np.zeros_like(table), np.stack([table, np.ones_like(table)], axis=2)

    def look_up(self, u: Inputs) -> Outputs:
        """The table's values, (n, ny); NaN where an input is not known."""
        cells, shares = zip(*(self._cell(u[:, k], k) for k in range(len(self.grid))), strict=True)
        out = np.zeros((len(u), len(self.outputs)))
        for corner in np.ndindex((2,) * len(self.grid)):
            weight = np.ones(len(u))
            for side, share in zip(corner, shares, strict=True):
                weight = weight * (share if side else 1.0 - share)
            index = tuple(cell + side for cell, side in zip(cells, corner, strict=True))
            out += weight[:, None] * self.values[index]
        return out

    def _cell(self, u: Any, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Lower corner and share of the way to the upper one."""
        levels = self.grid[k]
        at = np.clip(np.searchsorted(levels, u, side="right") - 1, 0, len(levels) - 2)
        share = (u - levels[at]) / (levels[at + 1] - levels[at])
        if self.beyond == "hold":
            share = np.clip(share, 0.0, 1.0)
        elif self.beyond == "error":
            share = np.where((u < levels[0]) | (u > levels[-1]), np.nan, share)
        return at, share

    def outside(self, u: Inputs) -> dict[str, int]:
        """Rows outside the measured range, per input that has some."""
        counts = {
            name: int(np.count_nonzero((u[:, k] < levels[0]) | (u[:, k] > levels[-1])))
            for k, (name, levels) in enumerate(zip(self.inputs.names, self.grid, strict=True))
        }
        return {name: count for name, count in counts.items() if count}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was measured, and what happens elsewhere."""
        ways = {
            "hold": "the edge is held", "line": "a straight line goes on",
            "error": "a row is an error",
        }  # fmt: skip
        ranges = [
            f"{channel.name} from {levels[0]:g} to {levels[-1]:g} {channel.unit}"
            for channel, levels in zip(self.inputs, self.grid, strict=True)
        ]
        return (f"measured for {', '.join(ranges)}; outside {ways[self.beyond]}",)


def _columns(named: Mapping[str, Any]) -> Float64[np.ndarray, "n k"]:
    columns = [np.asarray(column, dtype=np.float64) for column in named.values()]
    lengths = {name: len(c) for name, c in zip(named, columns, strict=True)}
    if len(set(lengths.values())) > 1:
        raise DataError(f"table: expected columns of one length, got {lengths}")
    return np.stack(columns, axis=1)


def _gridded(
    names: tuple[str, ...], u: Float64[np.ndarray, "n k"], y: Float64[np.ndarray, "n ny"]
) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Levels of each input, and outputs at every combination; repeated rows are averaged."""
    found = [np.unique(column, return_inverse=True) for column in u.T]
    grid = tuple(levels for levels, _ in found)
    for name, levels in zip(names, grid, strict=True):
        if len(levels) < 2:
            raise DataError(f"table: {name}: expected at least two values, got {len(levels)}")
    shape = tuple(len(levels) for levels in grid)
    flat = np.ravel_multi_index(tuple(at.ravel() for _, at in found), shape)
    count = np.bincount(flat, minlength=int(np.prod(shape)))
    if (count == 0).any():
        first = np.unravel_index(int(np.argmin(count)), shape)
        lacks = ", ".join(f"{n} = {g[i]:g}" for n, g, i in zip(names, grid, first, strict=True))
        raise DataError(
            f"table: expected a grid of {' x '.join(map(str, shape))} values, but "
            f"{np.count_nonzero(count == 0)} combinations lack (first: {lacks}): measure them, or "
            "leave an input out"
        )
    sums = [np.bincount(flat, column, minlength=len(count)) for column in y.T]
    values = np.stack(sums, axis=1) / count[:, None]
    return grid, values.reshape(*shape, y.shape[1])
