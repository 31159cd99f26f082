"""Inputs to come from a file, written as the recordings are or as the twin tells its channels.

A column of the recordings, by its heading, is read as the twin file reads it: scale, offset, unit.
A column with the name of a channel is in the unit of its heading, else in that in which the channel
is recorded, which is the unit that results are printed in; without one in SI. ``t`` [s] is the
time, or the recordings' own column of stamps. What an arm's file leaves out of speed and
acceleration is taken from the positions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.ahead.basis import Basis, Future
from evertwin.errors import DataError
from evertwin.fold import Block
from evertwin.rows.channels import recorded_as, unit_recorded
from evertwin.signals import Channel
from evertwin.signals.units import compatible, from_si, to_si
from evertwin.sources.small_table import Table, read_table
from evertwin.sources.spec import ChannelSpec
from evertwin.types import Vector

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
BEYOND = 0.05
"""Share of an input's recorded range by which it may leave it unsaid."""
FEW = 3
"""Inputs that are named one by one."""


def rows_of_file(basis: Basis, path: Path) -> tuple[Future, Mapping[str, Vector]]:
    """Inputs to come, and the outputs that the file plans.

    Raises:
        DataError: a column lacks or is of another quantity, the time does not rise, or a cell is
            empty.
    """
    plan = _Plan(basis, read_table(path))
    t = plan.time()
    if len(t) < 2 or not np.all(np.diff(t) > 0.0):
        raise DataError(f"{path}: expected two rows or more with a rising t [s]")
    inputs = basis.model.inputs
    u = np.ascontiguousarray(np.stack([plan.input(t, one) for one in inputs], axis=1))
    if not np.isfinite(u).all():
        row, column = (int(k[0]) for k in np.nonzero(~np.isfinite(u)))
        raise DataError(f"{path}: row {row + 1} lacks {inputs.names[column]}")
    dt = np.diff(t, prepend=t[0] - (t[1] - t[0]))
    planned = {one.name: plan.column(one) for one in basis.model.outputs if plan.has(one.name)}
    return Future(u, dt), planned


class _Plan(NamedTuple):
    """A table whose columns are channels."""

    basis: Basis
    table: Table

    def time(self) -> Vector:
        """Stamps of the rows [s]."""
        for source in self.basis.setup.spec.source:
            name, factor = source.time.column, SECONDS.get(source.time.unit)
            if isinstance(name, str) and name in self.table.names and factor:
                known = name in self.table.units or name in self.table.dates
                return self.table.column(name) * (1.0 if known else factor)
        return self.table.column("t")

    def has(self, name: str) -> bool:
        """Is there a column of a channel?"""
        return name in self.table.names or self._recorded(name) is not None

    def input(self, t: Vector, one: Channel) -> Vector:
        """A column, or a derivative of the arm's position ``q…``."""
        order = 2 if one.name.startswith("qdd") else 1 if one.name.startswith("qd") else 0
        if order == 0 or self.has(one.name):
            return self.column(one)
        inputs = self.basis.model.inputs
        q = inputs.channels[inputs.index("q" + one.name[order + 1 :])]
        spline: Any = scipy.interpolate.CubicSpline(t, self.column(q))
        return np.asarray(spline(t, order))

    def column(self, one: Channel) -> Vector:
        """A channel's column in SI.

        Raises:
            DataError: there is none, or its heading has the unit of another quantity.
        """
        told = self._recorded(one.name)
        if told is not None:
            name, unit = _heading(told)
            values = self.table.column(name)
            values = np.asarray(from_si(values, unit)) if unit else values
            return np.asarray(to_si(values * told.scale + told.offset, told.unit))
        values, written = self.table.column(one.name), self.table.written.get(one.name)
        if written is None:
            return np.asarray(to_si(values, unit_recorded(self.basis.setup.spec, one.name) or "1"))
        if not compatible(written, one.unit):
            raise DataError(
                f"{self.table.name}: {one.name} is in '{written}' by its heading, and the model's "
                f"in '{one.unit}': correct the heading, or leave its unit out"
            )
        return values

    def _recorded(self, name: str) -> ChannelSpec | None:
        """The setting of a channel's column, where the table has the recordings' own."""
        wanted = recorded_as(self.basis.setup.spec, name)
        for source in self.basis.setup.spec.source:
            told = source.channels.get(wanted)
            if told is None or not isinstance(told.column, str):
                continue
            heading, unit = _heading(told)
            if heading in self.table.names and self.table.written.get(heading, "") == unit:
                return told
        return None


def _heading(told: ChannelSpec) -> tuple[str, str]:
    """Name and unit of a recorded column's heading."""
    name, _, unit = str(told.column).partition("[")
    return name.strip(), unit.strip().removesuffix("]").strip().strip("-")


def beyond(basis: Basis, rows: Sequence[Block], future: Future) -> tuple[str, ...]:
    """Which inputs to come leave what was recorded: a sentence, where some do."""
    told = np.concatenate([one.u for one in rows])
    found = list[str]()
    for k, one in enumerate(basis.model.inputs):
        known, new = told[np.isfinite(told[:, k]), k], future.u[:, k]
        if one.kind == "angle" or not len(known):
            continue
        low, high = float(known.min()), float(known.max())
        slack = max(BEYOND * (high - low), 1e-9 * max(abs(low), abs(high)))
        if new.min() < low - slack or new.max() > high + slack:
            unit = basis.recorded.get(one.name) or one.unit
            to, was = (
                " … ".join(f"{float(from_si(end, unit)):.4g}" for end in ends)
                for ends in ((float(new.min()), float(new.max())), (low, high))
            )
            found.append(f"{one.name} {to}{'' if unit == '1' else f' {unit}'} (recorded {was})")
    if not found:
        return ()
    rest = [f"{len(found) - FEW} more"] if len(found) > FEW else []
    return (f"beyond what was recorded, so extrapolated: {', '.join(found[:FEW] + rest)}",)
