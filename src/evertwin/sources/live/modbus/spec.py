"""Settings of a Modbus TCP source: where its columns stand in the machine's registers.

>>> Register(10, "float32").words, Register(3, table="coil").words
(2, 1)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.settings.kinds import Duration, Finite
from evertwin.settings.notes import Shorthand
from evertwin.settings.section import Section
from evertwin.signals.units import conversion
from evertwin.sources.live.contract import LiveSettings

Order: TypeAlias = Literal["big", "little"]
Kind: TypeAlias = Literal[
    "bool", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"
]
WORDS = {"bool": 1, "int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "float32": 2}
"""Registers of a value; four of any other."""


@dataclass(frozen=True)
class Register(Section):
    """``[twin.source.registers]``: one column. See the module for an example."""

    shorthand = Shorthand("address")

    address: Annotated[int, Ge(0), Le(65535)]
    """Of its first register, counted from 0 (40001 in many manuals is 0)."""
    type: Kind = "uint16"
    """Coils and discrete inputs are ``bool`` whatever stands here."""
    table: Literal["holding", "input", "coil", "discrete"] = "holding"
    """Where it stands."""
    bit: Annotated[int, Ge(0), Le(15)] | None = None
    """One bit of a 16-bit register, 0 the lowest."""
    word_order: Order | None = None
    """Order of the registers of a value; absent: that of the machine."""
    byte_order: Order | None = None
    """Order of the bytes in a register; absent: that of the machine."""
    scale: Finite = 1.0
    """Multiplies the number in the registers (0.1 where 215 means 21.5)."""
    offset: Finite = 0.0
    """Added after ``scale``."""
    unit: str | None = None
    """Unit of the machine's number after that; absent: the unit that the twin file states."""
    sentinels: tuple[float, ...] = ()
    """Numbers in the registers that mean "no value" (0x8000, 65535), as bits or as the type reads
    them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unit is not None:
            conversion(self.unit)
        if self.address + self.words > 65536:
            raise UsageError(f"address: {self.type} at {self.address} ends beyond register 65535")
        if self.scale == 0.0:
            raise UsageError("scale: expected a factor other than 0: it would erase the column")
        if self.bit is not None and self.words != 1:
            raise UsageError(f"bit: expected a type of one register, got {self.type}")

    @property
    def is_bit(self) -> bool:
        """Does it stand in a table of bits?"""
        return self.table in ("coil", "discrete")

    @property
    def words(self) -> int:
        """Registers that it takes."""
        return 1 if self.is_bit else WORDS.get(self.type, 4)


@dataclass(frozen=True)
class ModbusSettings(LiveSettings):
    """``protocol = "modbus"``: registers of a machine, read by Modbus TCP. Nothing is ever written.

    >>> ModbusSettings("controller", "modbus").period
    0.1
    """

    host: str = "127.0.0.1"
    """Name or address of the machine."""
    port: Annotated[int, Ge(1), Le(65535)] = 502
    device: Annotated[int, Ge(0), Le(255)] = 1
    """Number of the unit behind that address."""
    period: Duration = 0.1
    """Time from reading to reading."""
    timeout: Duration = 1.0
    """Longest wait for an answer; then the line is closed, so that a late one is never taken for
    another."""
    word_order: Order = "big"
    """Order of the registers of a value."""
    byte_order: Order = "big"
    """Order of the bytes in a register."""
    sequence: str | None = None
    """Column that the machine changes with every sample (a counter, a time): read before and after
    the others, and all once more where it changed in between. What shows it unchanged since the
    last reading is no new sample; where it counts one by one, a gap is a counted loss."""
    registers: Mapping[str, Register] = field(default_factory=dict)
    """Column of the twin file → its register: ``speed = { address = 10, type = "float32" }``."""
