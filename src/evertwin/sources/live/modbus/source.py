"""Modbus TCP: a machine's registers, read as one coherent sample each period.

Registers that touch are read in blocks of at most `MOST`. Where the machine has a column that
changes with each sample (``sequence``), it is read before and after the others; what changed in
between is read again, and is no sample after `TRIES`.

>>> from evertwin.sources.live.modbus.spec import Register
>>> number_of(Register(0, "float32"), bytes.fromhex("42280000"), "big", "big")
42.0
>>> number_of(Register(0, "float32", word_order="little"), bytes.fromhex("00004228"), "big", "big")
42.0
>>> number_of(Register(0, "int16", sentinels=(0x8000,)), bytes.fromhex("8000"), "big", "big")
inf
"""

from __future__ import annotations

import asyncio
import logging
import math
import struct
import time
from collections.abc import AsyncIterator, Iterable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from evertwin.errors import UsageError
from evertwin.signals import compatible, conversion
from evertwin.sources.live.contract import Around
from evertwin.sources.live.counted import Counted
from evertwin.sources.live.decode import BAD, Columns, Raw
from evertwin.sources.live.line import DOWN, Line
from evertwin.sources.live.modbus.spec import ModbusSettings, Order, Register
from evertwin.sources.live.modbus.wire import Refused, Wire, WrongFrame
from evertwin.sources.spec import SourceSpec

MOST = 125
"""Registers that one answer can carry."""
MOST_BITS = 2000
LARGE = 1e12
"""Numbers beyond that, or below its inverse, are of no size that machines have."""
LOG = logging.getLogger("evertwin.live")
FASTER = "the machine went on faster than it was read: choose a shorter period"
UNTOLD, LOOKS = 32, 16
"""Samples after which is looked whether a machine counts them, in so many pauses between two."""
TRIES = 3
"""Readings of one sample, where the machine goes on in between."""
_CODES = {
    "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
    "float32": "f", "float64": "d", "bool": "H",
}  # fmt: skip


class Block(NamedTuple):
    """Registers or bits that are read together.

    >>> Block("holding", 10, 4).length
    4
    """

    table: str
    address: int
    length: int


class Torn(Exception):
    """The machine went on while it was read.

    >>> str(Torn("three times"))
    'three times'
    """


class Modbus(Line):
    """The source. Implements `LiveSource`.

    >>> Modbus.settings.__name__
    'ModbusSettings'
    """

    settings = ModbusSettings

    def __init__(self, settings: ModbusSettings, spec: SourceSpec, around: Around) -> None:
        super().__init__(settings, spec, around)
        self.machine = settings
        self.decoder.clock.polled = True
        self.blocks = blocks_of(settings.registers.values())
        self._places = {
            name: (k, register)
            for name, register in settings.registers.items()
            for k, block in enumerate(self.blocks)
            if _inside(register, block)
        }
        self._units = self._factors(spec)
        self._before: bytes | None = None
        self._count, self._came = Counted(), 0
        self._measured = {str(channel.column) for channel in spec.channels.values()}
        self.astray: dict[str, str] = {}
        """Column whose number is of no size that machines have, unless its words are swapped."""
        self._asked_for = Block("", 0, 0)
        """What is, or was, read just now."""
        self._away = False
        """Was the line down since the newest sample?"""

    def open(self) -> None:
        """See `LiveSource`."""
        super().open()
        asked = [*self.decoder.names, *filter(None, [self.machine.sequence])]
        lacking = [name for name in asked if name not in self.machine.registers]
        if lacking:
            raise UsageError(
                f"source {self.name!r}: [twin.source.registers] lack {', '.join(lacking)}: give "
                "each column of the twin file its address"
                + (", or state stamp = 'arrival'" if self.decoder.time in lacking else "")
            )

    async def session(self) -> AsyncIterator[Columns]:
        """One connection."""
        wire = Wire(self.machine.timeout)
        try:
            self._away = self._before is not None
            await wire.connect(self.machine.host, self.machine.port)
            due = time.monotonic()
            while True:
                columns = await self._sample(wire)
                if columns is not None:
                    self._lost(columns)
                    yield columns
                    await self._look(wire, due + 0.5 * self.machine.period)
                due = await self._wait(due + self.machine.period)
        finally:
            wire.close()

    async def _wait(self, due: float) -> float:
        behind = time.monotonic() - due
        missed = int(behind / self.machine.period)
        if missed > 0 and self.machine.sequence is None:
            self.told.lose("readings that took longer than the period", missed)
        if missed > 0:
            return due + missed * self.machine.period
        await asyncio.sleep(max(-behind, 0.0))
        return due

    async def _look(self, wire: Wire, until: float) -> None:
        """Does the machine count its samples, though no two that came follow each other?"""
        sequence = self.machine.sequence
        self._came += 1
        if sequence is None or self._count.known or not UNTOLD < self._came <= UNTOLD + LOOKS:
            return
        at = self.machine.registers[sequence]
        alone, numbers = Block(at.table, at.address, at.words), list[float | int]()
        while time.monotonic() < until:
            numbers.append(self._number(at, await self._read(wire, alone)))
        for before, after in pairwise(numbers):
            self._count.within(before, after)

    def _lost(self, columns: Columns) -> None:
        """What the machine said and nobody read: known where it counts samples, else by time."""
        sequence = self.machine.sequence
        if sequence is None:
            return self.lost_since(self.machine.period)
        missing = self._count.missing(columns[sequence])
        if missing > 0:
            self.told.lose(DOWN if self._away else FASTER, missing)
        self._away = False

    async def _sample(self, wire: Wire) -> Columns | None:
        """What the machine says now; None where that is no new sample, or none at all."""
        try:
            return await self._coherent(wire)
        except WrongFrame as error:
            self.told.reject(f"a wrong frame: {error}")
            raise
        except (Refused, Torn) as error:
            self.told.reject(str(error))
            self.told.reason = f"{self._named(self._asked_for)}: {error}"
            return None

    async def _coherent(self, wire: Wire) -> Columns | None:
        sequence = self.machine.sequence
        if sequence is None:
            return self._columns([await self._read(wire, block) for block in self.blocks])
        at = self.machine.registers[sequence]
        alone = Block(at.table, at.address, at.words)
        for _ in range(TRIES):
            before = await self._read(wire, alone)
            if before == self._before:
                return None
            raw = [await self._read(wire, block) for block in self.blocks]
            if await self._read(wire, alone) == before:
                self._before = before
                return self._columns(raw)
        raise Torn(f"{sequence} changed during each of {TRIES} readings")

    async def _read(self, wire: Wire, block: Block) -> bytes:
        self._asked_for = block
        return await wire.read(self.machine.device, *block)

    def _named(self, block: Block) -> str:
        """The columns that stand in a block, and where it is."""
        names = ", ".join(n for n, r in self.machine.registers.items() if _inside(r, block))
        return f"{names} ({block.table} {block.address})"

    def _columns(self, raw: list[bytes]) -> Columns:
        out: dict[str, Raw] = {}
        for name, (k, register) in self._places.items():
            start = register.address - self.blocks[k].address
            if register.is_bit:
                out[name] = bool(raw[k][start // 8] >> start % 8 & 1)
                continue
            part = raw[k][2 * start : 2 * (start + register.words)]
            value = self._number(register, part)
            if name in self._measured and name not in self.astray and not _plain(value):
                self._swapped(name, register, part)
            factor, zero = self._units.get(name, (1.0, 0.0))
            plain = (factor, zero) == (1.0, 0.0)
            out[name] = value if plain else value * factor + zero
        return out

    def _number(self, register: Register, part: bytes) -> float | int:
        return number_of(register, part, self.machine.word_order, self.machine.byte_order)

    def _swapped(self, name: str, register: Register, part: bytes) -> None:
        """Says where other words first would read a number of a size that machines have."""
        if not register.type.startswith("float") or part == bytes(len(part)):
            return
        order = register.word_order or self.machine.word_order
        byte = self.machine.byte_order
        other: Order = "little" if order == "big" else "big"
        read = (replace(register, word_order=one) for one in (order, other))
        was, value = (number_of(one, part, order, byte) for one in read)
        if math.isfinite(was) and _plain(value, 1e6):
            self.astray[name] = (
                f"{name} reads {was:.3g}: with word_order = {other!r} it would be {value:.4g}"
            )
            self.told.note(f"{name} is of no size that machines have: try word_order = {other!r}")
            self.told.hint = "; ".join(self.astray.values())
            LOG.warning("%s: %s", self.name, self.astray[name])

    def _factors(self, spec: SourceSpec) -> dict[str, tuple[float, float]]:
        """From the machine's unit of a column to the one that the twin file states."""
        out = {}
        for channel in spec.channels.values():
            register = self.machine.registers.get(str(channel.column))
            if register is None or register.unit is None:
                continue
            if not compatible(register.unit, channel.unit):
                raise UsageError(
                    f"source {spec.name!r}: {channel.column}: the register is in "
                    f"{register.unit!r}, the twin file wants {channel.unit!r}: another quantity"
                )
            (a, b), (c, d) = conversion(register.unit), conversion(channel.unit)
            out[str(channel.column)] = a / c, (b - d) / c
        return out


def _plain(value: float, most: float = LARGE) -> bool:
    """Is it of a size that machines have?

    >>> _plain(0.0), _plain(1.27e34), _plain(3e-30)
    (True, False, False)
    """
    return value == 0.0 or 1.0 / most <= abs(value) <= most


def number_of(register: Register, raw: bytes, word_order: Order, byte_order: Order) -> float | int:
    """The number in the bytes of its registers; a sentinel is infinite.

    Args:
        register: what it is.
        raw: its bytes as they came.
        word_order, byte_order: of the machine, where the register says nothing.
    """
    words = [raw[i : i + 2] for i in range(0, len(raw), 2)]
    if (register.byte_order or byte_order) == "little":
        words = [word[::-1] for word in words]
    if (register.word_order or word_order) == "little":
        words.reverse()
    whole = b"".join(words)
    bits = int.from_bytes(whole, "big")
    if register.bit is not None:
        return bits >> register.bit & 1
    value: float | int = struct.unpack(f">{_CODES[register.type]}", whole)[0]
    if register.type == "bool":
        value = int(value != 0)
    if value in register.sentinels or bits in register.sentinels:
        return BAD
    if (register.scale, register.offset) == (1.0, 0.0):
        return value
    return value * register.scale + register.offset


def blocks_of(registers: Iterable[Register]) -> list[Block]:
    """The fewest blocks that hold them; only what touches is read together.

    >>> blocks_of([Register(2), Register(0, "float32"), Register(9), Register(3, table="coil")])
    [Block(table='coil', address=3, length=1), Block(table='holding', address=0, length=3), ...]
    """
    out: list[Block] = []
    for register in sorted(registers, key=lambda r: (r.table, r.address, r.words)):
        end = register.address + register.words
        most = MOST_BITS if register.is_bit else MOST
        last = out[-1] if out else Block("", 0, 0)
        touches = register.table == last.table and register.address <= last.address + last.length
        if touches and end - last.address <= most:
            out[-1] = last._replace(length=max(last.length, end - last.address))
        else:
            out.append(Block(register.table, register.address, register.words))
    return out


def _inside(register: Register, block: Block) -> bool:
    end = block.address + block.length
    return (
        register.table == block.table
        and block.address <= register.address
        and register.address + register.words <= end
    )
