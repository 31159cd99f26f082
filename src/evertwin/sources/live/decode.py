"""Columns by name → a chunk in SI, by the twin file's own ``[source.channels]``.

So one twin file serves recordings and the running machine: names, units, scales, offsets and
sentinels are said once. A sentinel becomes infinite, which later stages mark as an error; a column
that is not there is NaN, absent. Nothing is left out without being counted.

>>> from evertwin.sources.live.telling import Telling
>>> from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
>>> spec = SourceSpec("pump", {"v": ChannelSpec("speed", "cm/s")}, time=TimeSpec("t", "ms"))
>>> decoder = Decoder(spec, Telling("pump"))
>>> (chunk,) = decoder.chunks({"t": 20, "speed": 5.0})
>>> chunk.t.tolist(), chunk.v.tolist()
([20000000], [[0.05]])
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.signals import conversion
from evertwin.signals.whole_steps import whole_steps
from evertwin.sources.clocks.dates import ORDERS
from evertwin.sources.clocks.stamps import NO_STAMP, StampError, to_ns
from evertwin.sources.live.contract import LiveSettings
from evertwin.sources.live.stamping import Stamping
from evertwin.sources.live.stamping import arrival as now
from evertwin.sources.live.telling import Telling
from evertwin.sources.spec import SourceSpec

Raw: TypeAlias = float | int | bool | str | bytes | list[Any] | None
Columns: TypeAlias = Mapping[str, Raw]
"""What a machine said at one moment, in the units of its own."""
PROTOCOL = "the protocol's own stamp"
"""Key of a stamp [ns] that comes with the columns and not as one of them."""
LATE = "late by its number"
"""Key of whether the machine's count says that these columns are of before the newest."""
BAD = math.inf
"""Stands for a value that the machine itself calls bad: later stages mark it as an error."""


class _Sample(NamedTuple):
    raw: np.ndarray
    code: float
    """Value of the column that opens tasks."""


class Decoder:
    """The decoder of one source. See the module for an example."""

    def __init__(
        self, spec: SourceSpec, told: Telling, settings: LiveSettings | None = None,
        *, arrives: bool = True,
    ) -> None:  # fmt: skip
        """``arrives``: do times of arrival mean anything?"""
        self.spec = spec
        self.told = told
        self.settings = LiveSettings(spec.name, "") if settings is None else settings
        self.clock: Stamping[_Sample] = Stamping(arrives=arrives)
        self.task = 0
        self._code = math.nan
        self._opened: int | None = None
        self._before: int | None = None
        self._offset = round(spec.offset * 1e9)
        self.by_protocol = False
        """Does the protocol itself bring stamps (`PROTOCOL`)?"""
        self._by_arrival = self.settings.stamp == "arrival" or spec.time.column is None
        channels = spec.channels.values()
        pairs = [conversion(channel.unit) for channel in channels]
        self._scale = np.array([(c.scale, c.offset) for c in channels]).reshape(-1, 2).T
        self._step = np.array([c.step for c in channels])
        self._unit = np.array(pairs).reshape(-1, 2).T
        self._columns = [c.column for c in channels]
        self._sentinels = [(j, c.sentinels) for j, c in enumerate(channels) if c.sentinels]

    def check(self, *, ordered: bool = False) -> None:
        """That every column has a name, unless they are ``ordered``, as those of a file.

        Raises:
            UsageError: one is a position, or the unit of time is to be guessed.
        """
        stamps = None if self.time is None else self.spec.time.column
        asked = [*self._columns, self.spec.task, stamps]
        for column in asked:
            if isinstance(column, int) and not ordered:
                raise UsageError(
                    f"source {self.spec.name!r}: column {column}: expected a name: a machine has "
                    "no order of columns (stamps may be those of arrival: stamp = 'arrival')"
                )
        if self.spec.time.unit == "auto" and self.time is not None:
            raise UsageError(
                f"source {self.spec.name!r}: time: unit = 'auto' holds for files: state s, ms, us, "
                "ns or iso"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Columns that are asked for, the one of time last, if any."""
        listed = [str(column) for column in self._columns]
        listed += [column for column in self.spec.where if column not in listed]
        if self.spec.task is not None and self.spec.task not in listed:
            listed.append(str(self.spec.task))
        return (*listed, *([] if self.time is None else [self.time]))

    @property
    def time(self) -> str | None:
        """Column of the stamps; None: they are of arrival, or the protocol's own."""
        return None if self._by_arrival or self.by_protocol else str(self.spec.time.column)

    def resume(self, stamp: int, task: int) -> None:
        """What is stored: nothing up to there comes again."""
        self.clock.resume(stamp)
        self.task = task

    def go_on(self, clock: tuple[int, ...]) -> None:
        """With the clock that was kept."""
        if self.clock.go_on(clock):
            self.told.note("the clock was set before this start")

    def chunks(self, columns: Columns, arrival: int | None = None) -> list[Chunk]:
        """What goes out on one more sample: mostly one chunk of one row, none where it is kept out.

        Args:
            columns: by name.
            arrival: when it came (`stamping.arrival`) [ns]; absent: now.
        """
        came = now() if arrival is None else arrival
        stamp = self._stamp(columns, came)
        if stamp is None or not self._wanted(columns):
            return []
        raw = self._values(columns)
        if raw is None:
            return []
        code = math.nan
        if self.spec.task is not None:
            code = self._number(self.spec.task, columns.get(str(self.spec.task)))
        before, late = self._counts(), bool(columns.get(LATE))
        out = self.clock.take(stamp, came, _Sample(raw, code), hash(raw.tobytes()), late)
        if before != self._counts():
            self._tell(before)
        return [self._chunk(stamp, sample) for stamp, sample in out]

    def _values(self, columns: Columns) -> np.ndarray | None:
        """What the columns say, as it comes; None where none of them is there."""
        raw = np.array([self._number(column, columns.get(str(column))) for column in self._columns])
        if len(raw) and np.isnan(raw).all():
            self.told.reject("no column of the twin in it")
            return None
        return raw

    def _counts(self) -> tuple[int, int, int, int]:
        return self.clock.repeated, self.clock.rejected, self.clock.set, self.clock.late

    def _tell(self, before: tuple[int, int, int, int]) -> None:
        self.told.repeated += self.clock.repeated - before[0]
        if self.clock.rejected > before[1]:
            self.told.reject("a stamp of no clock", self.clock.rejected - before[1])
        if self.clock.set > before[2]:
            self.told.note("the clock was set")
        if self.clock.late > before[3]:
            self.told.note("came late", self.clock.late - before[3])

    def _stamp(self, columns: Columns, arrival: int) -> int | None:
        if self._by_arrival:
            return arrival + self._offset
        if self.by_protocol:
            return int(columns[PROTOCOL] or 0) + self._offset  # type: ignore[arg-type]
        value = columns.get(str(self.spec.time.column))
        unit = self.spec.time.unit
        if isinstance(value, str | bytes):
            text = value.encode() if isinstance(value, str) else value
            cell = np.array([text[:64]])
        elif value is None or isinstance(value, bool | list) or unit in ORDERS:
            cell = np.array([None])
        else:
            cell = np.array([value])
        try:
            stamp = NO_STAMP if cell.dtype.kind == "O" else int(to_ns(cell, unit)[0])
        except StampError:
            stamp = NO_STAMP
        if abs(stamp) >= 2**62:
            self.told.reject("no stamp")
            return None
        return stamp + self._offset

    def _wanted(self, columns: Columns) -> bool:
        """Has it one of the values that ``where`` names?"""
        return all(
            self._number(column, columns.get(column)) in values
            for column, values in self.spec.where.items()
        )

    def _number(self, column: str | int, value: Raw) -> float:
        if isinstance(value, float):
            return value
        if value is None:
            return math.nan
        try:
            return float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            self.told.note(f"{column}: not a number")
            return math.nan

    def _si(self, raw: np.ndarray) -> np.ndarray:
        scale, unit = self._scale, self._unit
        with np.errstate(over="ignore", invalid="ignore"):
            taken = whole_steps(raw * scale[0] + scale[1], self._step)
            si: np.ndarray = taken * unit[0] + unit[1]
        for j, sentinels in self._sentinels:
            if raw[j] in sentinels:
                si[j] = BAD
        return si

    def _chunk(self, stamp: int, sample: _Sample) -> Chunk:
        si = self._si(sample.raw)
        self._open_task(stamp, sample.code)
        self.told.give(stamp)
        t = np.array([stamp], dtype=np.int64)
        return Chunk(self.spec.name, t, si[None], self.task, self.clock.lasting())

    def _open_task(self, stamp: int, code: float) -> None:
        began = stamp if self._opened is None else self._opened
        before = stamp if self._before is None else self._before
        changed = not (math.isnan(code) or math.isnan(self._code) or code == self._code)
        pause, every = self.settings.pause, self.settings.every
        silent = pause is not None and stamp - before >= pause * 1e9
        over = every is not None and stamp - began >= every * 1e9
        if changed or silent or over:
            self.task, began = self.task + 1, stamp
        self._code = self._code if math.isnan(code) else code
        self._opened, self._before = began, max(before, stamp)
