"""Modbus TCP, reading only: there is no function here that could write.

A frame goes out from one place (`request`), with function code 1 to 4. A frame that comes is
believed when transaction, protocol, unit, function, count and length are all what was asked for and
no byte follows; anything else is a `WrongFrame`, and its line is closed: what a line that lost its
step carries belongs to nobody.

>>> request(7, 1, 3, 100, 2).hex()
'000700000006010300640002'
>>> request(7, 1, 6, 100, 2)
Traceback (most recent call last):
evertwin.errors.LawBroken: modbus: function 6 is no reading: only 1 to 4 are ever sent
>>> answer(bytes.fromhex("00070000000701030400010002"), 7, 1, 3, 2).hex()
'00010002'
"""

from __future__ import annotations

import asyncio
import socket
import struct
from contextlib import suppress

from evertwin.errors import LawBroken
from evertwin.sources.live.line import LineDown

READS = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
"""Table → function code."""
_HEAD = struct.Struct(">HHHB")
LARGEST = 260
"""Bytes of the longest frame."""
EXCEPTIONS = {
    1: "illegal function", 2: "illegal address", 3: "illegal value", 4: "device failure",
    5: "acknowledge", 6: "device busy", 8: "memory parity", 10: "no path", 11: "no answer behind",
}  # fmt: skip


class WrongFrame(LineDown):
    """A frame that is not the answer to what was asked.

    >>> str(WrongFrame("another count"))
    'another count'
    """


class Refused(Exception):
    """The machine answers that it will not: an exception of Modbus.

    >>> str(Refused(2)), str(Refused(99))
    ('exception 2: illegal address', 'exception 99: unknown')
    """

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}: {EXCEPTIONS.get(code, 'unknown')}")


def request(transaction: int, device: int, function: int, address: int, count: int) -> bytes:
    """The frame that asks for ``count`` registers or bits.

    Raises:
        LawBroken: the function is none that reads.
    """
    if function not in READS.values():
        raise LawBroken(f"modbus: function {function} is no reading: only 1 to 4 are ever sent")
    return _HEAD.pack(transaction, 0, 6, device) + struct.pack(">BHH", function, address, count)


def length_of(head: bytes) -> int:
    """Bytes of the frame that begins so.

    Raises:
        WrongFrame: no frame of Modbus TCP begins so.
    """
    _, protocol, length, _ = _HEAD.unpack(head[:7])
    if protocol != 0:
        raise WrongFrame("another protocol")
    if not 3 <= length <= LARGEST - 6:
        raise WrongFrame("an impossible length")
    return 6 + int(length)


def answer(frame: bytes, transaction: int, device: int, function: int, count: int) -> bytes:
    """The registers or bits of a whole frame.

    Raises:
        WrongFrame: it answers something else.
        Refused: the machine will not.
    """
    if len(frame) < 9 or len(frame) != length_of(frame):
        raise WrongFrame("another length")
    got, _, _, unit = _HEAD.unpack(frame[:7])
    if got != transaction:
        raise WrongFrame("another transaction")
    if unit != device:
        raise WrongFrame("another unit")
    if frame[7] == function | 0x80 and len(frame) == 9:
        raise Refused(frame[8])
    if frame[7] != function:
        raise WrongFrame("another function")
    size = 2 * count if function in (3, 4) else (count + 7) // 8
    if frame[8] != size or len(frame) != 9 + size:
        raise WrongFrame("another count")
    return frame[9:]


class Wire:
    """One connection. Opened by `connect`, closed by whatever goes wrong.

    >>> Wire(1.0).transaction
    0
    """

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self.transaction = 0
        self._socket: socket.socket | None = None

    async def connect(self, host: str, port: int) -> None:
        """Connect.

        Raises:
            OSError, TimeoutError: nobody is there.
        """
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(self.timeout):
            found = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            family, kind, protocol, _, address = found[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            await loop.sock_connect(self._socket, address)

    async def read(self, device: int, table: str, address: int, count: int) -> bytes:
        """Registers or bits as they stand in the machine.

        Raises:
            Refused: the machine will not; the line stays.
            LineDown, OSError, TimeoutError: wrong frame, or none in time; the line is closed.
        """
        try:
            async with asyncio.timeout(self.timeout):
                return await self._exchange(device, READS[table], address, count)
        except (LineDown, OSError, TimeoutError, asyncio.CancelledError):
            self.close()
            raise

    async def _exchange(self, device: int, function: int, address: int, count: int) -> bytes:
        line = self._socket
        if line is None:
            raise LineDown("the line is closed")
        with suppress(BlockingIOError):
            if line.recv(1):
                raise WrongFrame("bytes that nobody asked for")
            raise LineDown("the machine closed the line")
        self.transaction = self.transaction % 0xFFFF + 1
        loop = asyncio.get_running_loop()
        await loop.sock_sendall(line, request(self.transaction, device, function, address, count))
        frame, wanted = b"", 7
        while len(frame) < wanted:
            part = await loop.sock_recv(line, 2 * LARGEST)
            if not part:
                raise LineDown("the machine closed the line")
            frame += part
            if len(frame) >= 7:
                wanted = length_of(frame)
        return answer(frame, self.transaction, device, function, count)

    def close(self) -> None:
        """Let go. May be called again."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
