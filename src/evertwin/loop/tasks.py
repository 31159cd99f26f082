"""From recorded channels to rows, one task at a time: clock, filter, derived channels, crop.

Used where something needs a whole task (resampling, zero-phase filter, derivatives, crop). A
command acts from its stamp on, so a row's held input is the newest one *before* its interval; a
measured input (``hold = false``) is the one at the row itself.

>>> from evertwin.config.spec import ModelSpec, TwinSpec
>>> spec = TwinSpec(name="x", model=ModelSpec(kind="x"))
>>> series = {"v": (np.array([0, 10**9]), np.array([1.0, 3.0]))}
>>> rows = Table.on_union(series, spec)
>>> rows.columns["v"].tolist()
[1.0, 3.0]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy.signal import savgol_filter

from evertwin.config.spec import DeriveSpec, TwinSpec
from evertwin.errors import ConfigError, DataError
from evertwin.fold import Block, make_block
from evertwin.models import Model
from evertwin.signals.filters import Butterworth, by_segment
from evertwin.signals.resample import linear
from evertwin.signals.units import compatible
from evertwin.sync.horizon import nanoseconds
from evertwin.types import Stamps, Vector

__all__ = [
    "Series",
    "Table",
    "check_units",
    "is_held",
    "is_measured",
    "recorded_as",
    "rows_of_task",
]

Series: TypeAlias = Mapping[str, tuple[Stamps, Vector]]
"""Channel → (stamps [ns], values [SI])."""


@dataclass(frozen=True)
class Table:
    """Channels of one task on one clock.

    >>> Table(np.array([0]), {"v": np.array([1.0])}).columns["v"].tolist()
    [1.0]
    """

    t: Stamps
    columns: Mapping[str, Vector]

    @classmethod
    def on_union(cls, series: Series, spec: TwinSpec) -> Table:
        """On the union of all stamps; values only where they were measured."""
        t = np.unique(np.concatenate([stamps for stamps, _ in series.values()]))
        columns = {}
        for name, (stamps, values) in series.items():
            column = np.full(len(t), np.nan)
            column[np.searchsorted(t, stamps)] = values
            columns[name] = column
        return cls(t, columns)

    @classmethod
    def on_grid(cls, series: Series, rate: float, gap: float) -> Table:
        """On a uniform grid; interpolated, and left out inside gaps longer than ``gap`` [s]."""
        first = max(int(stamps[0]) for stamps, _ in series.values())
        last = min(int(stamps[-1]) for stamps, _ in series.values())
        if last <= first:
            raise DataError("the sources of this task do not overlap in time: check their clocks")
        n = int((last - first) * 1e-9 * rate) + 1
        t = first + np.rint(np.arange(n) * 1e9 / rate).astype(np.int64)
        longest = nanoseconds(gap)
        columns = {
            name: linear(stamps, values[:, None], t, longest)[:, 0]
            for name, (stamps, values) in series.items()
        }
        return cls(t, columns)

    def keep(self, where: np.ndarray) -> Table:
        """The rows at which ``where`` is true."""
        return Table(self.t[where], {name: v[where] for name, v in self.columns.items()})

    def column(self, name: str) -> Vector:
        """A channel by name.

        Raises:
            ConfigError: it is neither recorded nor derived.
        """
        if name not in self.columns:
            raise ConfigError(
                f"channel {name!r} is neither recorded nor derived: there are "
                f"{', '.join(self.columns)}; name it in [source.channels] or [[derive]], or say "
                f"[signals.{name}] source = …"
            )
        return self.columns[name]


def _derivative(table: Table, columns: list[Vector], value: float) -> Vector:
    seconds = (table.t - table.t[0]) * 1e-9
    if len(seconds) < 3:
        return np.full(len(seconds), np.nan)
    return np.asarray(np.gradient(columns[0], seconds))


def _middle(table: Table, columns: list[Vector], value: float) -> Vector:
    """Mean over the interval into each row, if the value changes steadily."""
    column = columns[0]
    return np.concatenate([column[:1], 0.5 * (column[1:] + column[:-1])])


def _slope(table: Table, columns: list[Vector], value: float) -> Vector:
    """Derivative of a cubic through the rows within ``value`` seconds of a uniform clock."""
    n = len(table.t)
    interval = float(table.t[-1] - table.t[0]) * 1e-9 / max(n - 1, 1)
    rows = 2 * round(0.5 * value / interval) + 1 if interval > 0 else 0
    if not 5 <= rows <= n:
        raise ConfigError(
            f"[[derive]] slope: value = {value:g} s is {rows} rows, a cubic needs 5 to {n}"
        )
    return np.asarray(savgol_filter(columns[0], rows, 3, deriv=1, delta=interval))


def _along(table: Table, columns: list[Vector], value: float) -> Vector:
    """Way along the heading so far, from x, y and heading (the mean one of each interval)."""
    x, y, heading = columns[0], columns[1], np.unwrap(columns[2])
    middle = 0.5 * (heading[1:] + heading[:-1])
    steps = np.diff(x) * np.cos(middle) + np.diff(y) * np.sin(middle)
    return np.asarray(np.r_[0.0, np.cumsum(steps)])


def _way(table: Table, columns: list[Vector], value: float) -> Vector:
    """Length of the path so far, negative where the task as a whole went backwards."""
    path = np.r_[0.0, np.cumsum(np.hypot(np.diff(columns[0]), np.diff(columns[1])))]
    backwards = len(path) > 0 and _along(table, columns, value)[-1] < 0.0
    return np.asarray(-path if backwards else path)


_OPERATIONS: Mapping[str, Callable[[Table, list[Vector], float], Any]] = {
    "derivative": _derivative,
    "along": _along,
    "way": _way,
    "middle": _middle,
    "slope": _slope,
    "sum": lambda _, c, v: np.sum(c, axis=0),
    "mean": lambda _, c, v: np.mean(c, axis=0),
    "difference": lambda _, c, v: c[0] - c[1],
    "product": lambda _, c, v: np.prod(c, axis=0),
    "scale": lambda _, c, v: c[0] * v,
    "norm": lambda _, c, v: np.sqrt(np.sum(np.square(c), axis=0)),
    "max": lambda _, c, v: np.max(np.abs(c), axis=0),
}


def _derived(table: Table, derive: tuple[DeriveSpec, ...]) -> Table:
    columns = dict(table.columns)
    for item in derive:
        parts = [Table(table.t, columns).column(name) for name in item.source]
        columns[item.name] = np.asarray(_OPERATIONS[item.op](table, parts, item.value), dtype=float)
    return Table(table.t, columns)


def _filtered(table: Table, spec: TwinSpec) -> Table:
    rule = spec.filter
    if rule is None or not rule.inputs:
        return table
    if spec.clock.rate is None:
        raise ConfigError("[filter] inputs: a filter over inputs needs a [clock] rate")
    smooth = Butterworth(rule.cutoff, spec.clock.rate, rule.order)
    columns, none = dict(table.columns), np.zeros(len(table.t), dtype=np.bool_)
    for name in rule.inputs:
        column = table.column(name)[:, None]
        columns[name] = by_segment(smooth, column, none, smooth.shortest)[:, 0]
    return Table(table.t, columns)


def _cropped(table: Table, spec: TwinSpec) -> Table:
    clock = spec.clock
    seconds = (table.t - table.t[0]) * 1e-9
    where = (seconds >= clock.start) & (seconds <= clock.stop)
    if clock.crop is not None:
        size = np.max([np.abs(table.column(name)) for name in clock.crop.channels], axis=0)
        moves = np.flatnonzero(size > clock.crop.above)
        if len(moves) == 0:
            return table.keep(np.zeros(len(seconds), dtype=np.bool_))
        inside = clock.crop.inside
        first, last = seconds[moves[0]] + inside, seconds[moves[-1]] - inside
        where &= (seconds >= first) & (seconds <= last)
    return table.keep(where)


def rows_of_task(series: Series, spec: TwinSpec, model: Model, row: int, task: int) -> Block | None:
    """The rows of one task; None when nothing is left of it.

    Raises:
        ConfigError: a channel of the model is neither recorded nor derived.
        DataError: the sources do not overlap.
    """
    clock = spec.clock
    table = (
        Table.on_union(series, spec)
        if clock.rate is None
        else Table.on_grid(series, clock.rate, clock.gap)
    )
    table = _cropped(_derived(_filtered(table, spec), spec.derive), spec)
    if len(table.t) == 0:
        return None
    u = np.stack(
        [_input(table, spec, name, len(model.states) > 0) for name in model.inputs.names], axis=1
    )
    y = np.stack([_output(table, spec, name) for name in model.outputs.names], axis=1)
    block = make_block(table.t, u, y, row=row, task=task)
    gap = block.gap | (block.dt > clock.gap)
    gap[0] = True
    return block._replace(gap=gap)


def is_measured(spec: TwinSpec, name: str) -> bool:
    """Is an output recorded? A virtual sensor is not."""
    rule = spec.signals.get(name)
    return rule is None or rule.measured


def _output(table: Table, spec: TwinSpec, name: str) -> Vector:
    if not is_measured(spec, name):
        return np.full(len(table.t), np.nan)
    return table.column(recorded_as(spec, name))


def recorded_as(spec: TwinSpec, name: str) -> str:
    """The recorded or derived channel that is a channel of the model."""
    rule = spec.signals.get(name)
    return name if rule is None or rule.source is None else rule.source


def check_units(spec: TwinSpec, model: Model) -> None:
    """Does each channel measure what the model takes or gives? A pure number may be anything.

    Raises:
        ConfigError: names the channel and both units.
    """
    derived = {one.name for one in spec.derive}
    for channel in (*model.inputs, *model.outputs):
        name = recorded_as(spec, channel.name)
        for source in spec.source:
            told = source.channels.get(name)
            # A scale may turn one quantity into another: a current into a torque.
            if told is None or name in derived or told.scale != 1.0:
                continue
            if compatible(told.unit, channel.unit) or "1" in (told.unit, channel.unit):
                continue
            raise ConfigError(
                f"source {source.name!r}: channel {name!r} is in '{told.unit}', and the model's "
                f"{channel.name!r} in '{channel.unit}': correct the unit in [source.channels], or "
                f"say [signals.{channel.name}] source = …"
            )


def is_held(spec: TwinSpec, name: str, dynamic: bool) -> bool:
    """Is an input a command, held from its stamp on? Usually that of a ``dynamic`` model is."""
    rule = spec.signals.get(name)
    return dynamic if rule is None or rule.hold is None else rule.hold


def _input(table: Table, spec: TwinSpec, name: str, dynamic: bool) -> Vector:
    values = table.column(recorded_as(spec, name))
    if not is_held(spec, name, dynamic):
        known = np.flatnonzero(~np.isnan(values))
        return (
            values
            if len(known) in (0, len(values))
            else np.interp(table.t, table.t[known], values[known])
        )
    known = np.where(np.isnan(values), -1, np.arange(len(values)))
    newest = np.maximum.accumulate(known)
    last = np.where(newest < 0, np.nan, values[newest])
    return np.concatenate([last[:1], last[:-1]])
