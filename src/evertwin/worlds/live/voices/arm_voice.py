"""The arm speaks Modbus TCP and OPC UA, each server behind a cable."""

from __future__ import annotations

from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.voices.cable import Address, Cable
from evertwin.worlds.live.voices.modbus import ModbusServer, Registers
from evertwin.worlds.live.voices.opcua import OpcUaServer
from evertwin.worlds.live.voices.voices import inside


class ArmVoice:
    """What the arm says, on the addresses ``modbus`` and ``opcua``; None: not by this one.

    >>> ArmVoice(("q1",), ("127.0.0.1", 5020), None).cables
    {}
    """

    def __init__(
        self, names: tuple[str, ...], modbus: Address | None, opcua: Address | None
    ) -> None:
        self.names, self._modbus, self._opcua = names, modbus, opcua
        self.cables: dict[str, Cable] = {}
        self._registers: ModbusServer | None = None
        self._variables: OpcUaServer | None = None

    async def open(self) -> dict[str, str]:
        told: dict[str, str] = {}
        if self._modbus is not None:
            self._registers = ModbusServer(Registers(self.names))
            host, port = await self._lay("modbus", self._modbus, at := inside())
            await self._registers.open(at)
            told["modbus"] = f"{host}:{port}"
        if self._opcua is not None:
            public = await self._lay("opcua", self._opcua, at := inside())
            self._variables = OpcUaServer("arm", self.names, public)
            await self._variables.open(at)
            told["opcua"] = self._variables.url
        return told

    async def _lay(self, name: str, near: Address, far: Address) -> Address:
        self.cables[name] = Cable(near, far)
        return await self.cables[name].open()

    async def say(self, sample: Sample) -> None:
        if self._registers is not None:
            self._registers.say(sample.columns)
        if self._variables is not None:
            await self._variables.say(sample.columns)

    async def close(self) -> None:
        for cable in self.cables.values():
            await cable.close()
        if self._registers is not None:
            await self._registers.close()
        if self._variables is not None:
            await self._variables.close()
