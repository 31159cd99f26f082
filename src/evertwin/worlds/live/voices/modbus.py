"""The machine's registers, read by Modbus TCP; nothing can be written.

All values lie in one block, so that one read is one sample: its number first (two registers), then
the time (float64, four registers), then every value as float32 in two registers, the high word
first. Holding registers (function 3) and input registers (function 4) show the same.

>>> table = Registers(("q1", "tau1"))
>>> table.address
{'seq': 0, 't': 2, 'q1': 6, 'tau1': 8}
>>> table.words({"seq": 65537, "t": 0.5, "q1": 1.0, "tau1": -2.0})
[1, 1, 16352, 0, 0, 0, 16256, 0, 49152, 0]
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from evertwin.worlds.live.voices.cable import Address

UNIT = 1
WIDTH = {"seq": (2, "I"), "t": (4, "d")}
"""Registers of the first two, and their form; all others are float32."""


@dataclass(frozen=True)
class Registers:
    """Where each value lies. See the module for an example."""

    names: tuple[str, ...]

    @property
    def _all(self) -> tuple[str, ...]:
        return (*WIDTH, *self.names)

    @property
    def address(self) -> dict[str, int]:
        """First register of each value, from 0."""
        found, at = {}, 0
        for name in self._all:
            found[name] = at
            at += WIDTH.get(name, (2, "f"))[0]
        return found

    def words(self, values: Mapping[str, float | Sequence[float]]) -> list[int]:
        """The registers that show these values."""
        form = ">" + "".join(WIDTH.get(name, (2, "f"))[1] for name in self._all)
        packed = struct.pack(form, *(values[name] for name in self._all))
        return list(struct.unpack(f">{len(packed) // 2}H", packed))


class ModbusServer:
    """Shows the newest sample; is busy until there is one.

    >>> ModbusServer(Registers(("q1",))).words
    []
    """

    def __init__(self, registers: Registers) -> None:
        self.registers = registers
        self.words: list[int] = []
        self._server: ModbusTcpServer | None = None

    async def open(self, near: Address) -> Address:
        """Listens; returns where."""
        empty = self.registers.words(dict.fromkeys(self.registers.address, 0))
        block = SimData(0, values=empty, datatype=DataType.REGISTERS, readonly=True)
        device = SimDevice(UNIT, [block], action=self._read)
        self._server = ModbusTcpServer(device, address=near)
        await self._server.serve_forever(background=True)
        return near

    async def _read(
        self, code: int, start: int, address: int, count: int, registers: list[int],
        written: list[int] | list[bool] | None,
    ) -> ExcCodes | None:  # fmt: skip
        if written is not None:
            return ExcCodes.ILLEGAL_FUNCTION
        if not self.words:
            return ExcCodes.DEVICE_BUSY
        registers[:] = self.words
        return None

    def say(self, columns: Mapping[str, float | Sequence[float]]) -> None:
        """A newer sample: all of it at once."""
        self.words = self.registers.words(columns)

    async def close(self) -> None:
        """Listens no more."""
        if self._server is not None:
            await self._server.shutdown()  # type: ignore[no-untyped-call]
