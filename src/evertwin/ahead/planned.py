"""Inputs to come from a file, written as the recordings are or as the twin tells its channels.

A column of the recordings, by its heading, is read as the twin file reads it: scale, offset, unit.
A column with the name of a channel is in the unit of its heading, else in that in which the channel
is recorded, which is the unit that results are printed in; without one in SI. ``t`` [s] is the
time, or the recordings' own column of stamps. What an arm's file leaves out of speed and
acceleration is taken from the positions.

Between two rows the machine is simulated at its usual step: a command is held, as it is between the
stamps of a recording, other inputs go on a line. The last row is one step more. Of a forecast, time
counts from now, the newest recorded row: its inputs are held until the first of the plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.ahead.basis import Basis, Future, check_count, known_inputs, usual_step
from evertwin.errors import DataError
from evertwin.fold import Block
from evertwin.rows.channels import is_held, recorded_as, unit_told
from evertwin.signals import Channel, wrap
from evertwin.signals.units import compatible, from_si, to_si
from evertwin.sources.clocks.stamps import seconds_of
from evertwin.sources.spec import ChannelSpec
from evertwin.sources.texts.small_table import Table, read_table
from evertwin.types import Bools, Float64, Int64, Intervals, Outputs, Vector

BEYOND = 0.05
"""Share of an input's recorded range by which it may leave it unsaid."""
FEW = 3
"""Inputs that are named one by one."""


class Planned(NamedTuple):
    """A file of inputs to come, or its beginning.

    >>> Planned(Path("next.csv")).until
    inf
    """

    path: Path
    until: float = math.inf
    """How much of it is taken [s]."""


def rows_of_file(basis: Basis, path: Path, step: float) -> tuple[Future, Mapping[str, Vector]]:
    """Inputs to come, and the outputs that the file plans, at its rows; NaN between them.

    Args:
        basis: the live version.
        path: the file.
        step: how far rows of the machine are apart, as a rule [s].

    Raises:
        DataError: a column lacks or is of another quantity, the time does not rise, or a cell is
            empty.
    """
    return _read(_Plan(basis, read_table(path)), path, step)[1:]


def from_now(basis: Basis, path: Path, newest: Block) -> tuple[Future, tuple[str, ...]]:
    """Inputs to come after a recorded block, and what is to be said of when they begin.

    Raises:
        DataError: as `rows_of_file`; or a row lies before now.
    """
    step, held = usual_step(newest), known_inputs(newest)[-1]
    plan = _Plan(basis, read_table(path), _stand(basis, held))
    begin, future, _ = _read(plan, path, step)
    if plan.dated:  # one from before the recording ended is of another day
        begin = max(begin - 1e-9 * float(newest.t[-1]), 0.0)
    if begin < 0.0:
        raise DataError(f"{path}: row 1 is at {begin:g} s: t counts from now, expected 0 or more")
    n = int(np.rint(begin / step)) or int(begin > 0.0)
    check_count(float(n + len(future.dt)))
    u = np.concatenate([np.repeat(held[None], n, axis=0), future.u])
    dt = np.concatenate([np.full(n, begin / max(n, 1)), future.dt])
    said = f"{path.name} begins {begin:.6g} s from now: until then the newest inputs are held"
    return Future(np.ascontiguousarray(u), dt), (said,) * (n > 1)


def _read(plan: _Plan, path: Path, step: float) -> tuple[float, Future, Mapping[str, Vector]]:
    """Time of the first row [s]; and what `rows_of_file` returns."""
    basis, t = plan.basis, plan.time()
    if len(t) < 2 or not np.all(np.diff(t) > 0.0):
        raise DataError(f"{path}: expected two rows or more with a rising t [s]")
    fine, inputs, dynamic = _Fine.of(t, step), basis.model.inputs, len(basis.model.states) > 0
    held = [is_held(basis.setup.spec, name, dynamic) for name in inputs.names]
    u = [plan.input(t, fine, one, held[k]) for k, one in enumerate(inputs)]
    planned = {one.name: plan.column(one) for one in basis.model.outputs if plan.has(one.name)}
    at_rows = {name: np.where(fine.first, column[fine.row], np.nan)
               for name, column in planned.items()}  # fmt: skip
    return float(t[0]), Future(np.ascontiguousarray(np.stack(u, axis=1)), fine.dt), at_rows


def _stand(basis: Basis, now: Float64[np.ndarray, " nu"]) -> Mapping[str, float]:
    """What scans show among the inputs of a row."""
    spec, names = basis.setup.spec, basis.model.inputs.names
    shown = () if spec.perception is None else spec.perception.channels
    return {name: float(v) for name, v in zip(names, now, strict=True)
            if recorded_as(spec, name) in shown}  # fmt: skip


class _Fine(NamedTuple):
    """Rows of a plan, and the steps of the machine between them."""

    row: Int64[np.ndarray, " n"]
    """The newest row of the plan."""
    first: Bools
    """Is it of that moment?"""
    at: Float64[np.ndarray, " n"]
    """Time of the plan [s]."""
    dt: Intervals

    @classmethod
    def of(cls, t: Vector, step: float) -> _Fine:
        """
        >>> _Fine.of(np.array([0.0, 10.0]), 4.0).dt.tolist()
        [5.0, 5.0, 5.0]
        """
        gaps = np.diff(t)
        parts = np.append(np.maximum(np.rint(gaps / step), 1.0), 1.0)
        check_count(float(parts.sum()))
        count = parts.astype(np.int64)
        row = np.repeat(np.arange(len(t)), count)
        dt = (np.append(gaps, gaps[-1] / parts[-2]) / parts)[row]
        within = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        return cls(row, within == 0, t[row] + within * dt, dt)


class _Plan(NamedTuple):
    """A table whose columns are channels."""

    basis: Basis
    table: Table
    stand: Mapping[str, float] = MappingProxyType({})
    """Inputs that scans show, such as tables, as they are now: a plan need not name them."""

    def time(self) -> Vector:
        """Stamps of the rows [s]."""
        name, factor = self._clock
        return self.table.column(name) * factor

    @property
    def dated(self) -> bool:
        """Are they dates?"""
        return self._clock[0] in self.table.dates

    @property
    def _clock(self) -> tuple[str, float]:
        """The column of stamps, and its unit [s]."""
        for source in self.basis.setup.spec.source:
            name, factor = source.time.column, seconds_of(source.time.unit)
            if isinstance(name, str) and name in self.table.names and factor:
                known = name in self.table.units or name in self.table.dates
                return name, 1.0 if known else factor
        return "t", 1.0

    def has(self, name: str) -> bool:
        """Is there a column of a channel?"""
        return name in self.table.names or self._recorded(name) is not None

    def input(self, t: Vector, fine: _Fine, one: Channel, held: bool) -> Float64[np.ndarray, " n"]:
        """An input at each step: its column, or a derivative of the arm's position ``q…``."""
        if one.name in self.stand and not self.has(one.name):
            return np.full(len(fine.row), self.stand[one.name])
        order = 2 if one.name.startswith("qdd") else 1 if one.name.startswith("qd") else 0
        given = order == 0 or self.has(one.name)
        name = one.name if given else "q" + one.name[order + 1 :]
        inputs = self.basis.model.inputs
        column = self.column(inputs.channels[inputs.index(name)])
        if not np.isfinite(column).all():
            row = int(np.argmin(np.isfinite(column)))
            raise DataError(f"{self.table.name}: row {row + 1} lacks {name}")
        if given and held:
            return np.asarray(column[fine.row])
        speed = f"qd{name[1:]}"
        if given and (not name.startswith("q") or speed not in inputs.names or self.has(speed)):
            return np.asarray(np.interp(fine.at, t, column))
        course: Any = scipy.interpolate.CubicSpline(t, column)
        return np.asarray(course(fine.at, 0 if given else order))

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
            return np.asarray(to_si(values, unit_told(self.basis.setup.spec, one) or "1"))
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


def _range(basis: Basis, rows: Sequence[Block], k: int) -> tuple[float, float, float] | None:
    """Lowest and highest recorded value of an input, and by how much more it may leave them unsaid;
    None of an angle, or where nothing is known."""
    told = np.concatenate([one.u[:, k] for one in rows])
    known = told[np.isfinite(told)]
    if basis.model.inputs.channels[k].kind == "angle" or not len(known):
        return None
    low, high = float(known.min()), float(known.max())
    return low, high, max(BEYOND * (high - low), 1e-9 * max(abs(low), abs(high)))


def off_beyond(
    basis: Basis, rows: Sequence[Block], future: Future, outputs: Callable[[Future], Outputs]
) -> Outputs:
    """By what outputs may be off because inputs leave what was recorded, (n, ny).

    What a form lacks there nobody has seen. As the next term of a series it grows with what the
    inputs change beyond the edge and with how far they are: all of it one recorded width away.
    """
    u, off = future.u.copy(), np.zeros(len(future.u))
    for k in range(u.shape[1]):
        ends = _range(basis, rows, k)
        if ends is not None:
            low, high, slack = ends
            inside = np.clip(u[:, k], low - slack, high + slack)
            off = np.maximum(off, np.abs(u[:, k] - inside) / max(high - low, slack, 1e-300))
            u[:, k] = inside
    if not off.any():
        return np.zeros((len(u), len(basis.model.outputs)))
    apart = wrap(outputs(future) - outputs(Future(u, future.dt)), basis.model.outputs.angles)
    return np.asarray(np.abs(apart) * np.minimum(np.maximum.accumulate(off), 1.0)[:, None])


def beyond(basis: Basis, rows: Sequence[Block], future: Future) -> tuple[str, ...]:
    """Which inputs to come leave what was recorded: a sentence, where some do."""
    found = list[str]()
    for k, one in enumerate(basis.model.inputs):
        ends, new = _range(basis, rows, k), future.u[:, k]
        if ends is None:
            continue
        low, high, slack = ends
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
