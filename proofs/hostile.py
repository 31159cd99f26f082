"""Modbus against peers that lie: frames that are random, cut, mixed up or refused, wrong values 0.

    python -m proofs.hostile [FRAMES]

Every answer of the peer is hostile but for one in fifty, which is right and carries a value that no
other frame can carry: so each value that comes out is known to be right or wrong. The frames go
through a real socket, and through the source with its decoder.
"""

from __future__ import annotations

import asyncio
import random
import socket
import struct
import sys
import threading
import time
from collections import Counter
from contextlib import suppress

from evertwin.sources.live import open_live
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from proofs._verdict import ended

FRAMES = 100_000
RIGHT = 0.02
COUNT = 4
_RNG = random.Random(20260713)


def right(asked: bytes, value: int) -> bytes:
    """The answer that was asked for: a number and its complement."""
    content = struct.pack(">II", value, value ^ 0xFFFFFFFF)
    return asked[:4] + struct.pack(">HBBB", 3 + len(content), asked[6], 3, len(content)) + content


def hostile(asked: bytes) -> tuple[str, bytes]:
    """One wrong answer and what is wrong with it; its numbers never fit together."""
    value = _RNG.getrandbits(32)
    content = struct.pack(">II", value, value)
    head = struct.pack(">BBB", asked[6], 3, len(content))
    good = asked[:4] + struct.pack(">H", 3 + len(content)) + head + content
    kind = _RNG.choice(
        ("random", "cut", "count", "unit", "function", "transaction", "exception", "protocol",
         "length", "longer", "flipped", "other count, whole", "late", "nothing")
    )  # fmt: skip
    other = _RNG.randrange(1, 256)
    if kind == "random":
        return kind, _RNG.randbytes(_RNG.randrange(1, 300))
    if kind == "cut":
        return kind, good[: _RNG.randrange(1, len(good))]
    if kind == "count":
        return kind, good[:8] + bytes([(good[8] + other) % 256]) + good[9:]
    if kind == "unit":
        return kind, good[:6] + bytes([(good[6] + other) % 256]) + good[7:]
    if kind == "function":
        return kind, good[:7] + bytes([(good[7] + other) % 256]) + good[8:]
    if kind == "transaction":
        return kind, struct.pack(">H", (struct.unpack(">H", good[:2])[0] + other) % 65536) + good[
            2:
        ]
    if kind == "exception":
        return kind, asked[:4] + struct.pack(">HBBB", 3, asked[6], 0x83, other)
    if kind == "protocol":
        return kind, good[:2] + struct.pack(">H", other) + good[4:]
    if kind == "length":
        return kind, good[:4] + struct.pack(">H", _RNG.getrandbits(16)) + good[6:]
    if kind == "longer":
        return kind, good + _RNG.randbytes(other)
    if kind == "flipped":
        at = _RNG.choice((0, 1, 2, 3, 4, 5, 6, 7, 8))
        return kind, good[:at] + bytes([good[at] ^ 1 << _RNG.randrange(8)]) + good[at + 1 :]
    if kind == "other count, whole":
        short = _RNG.choice((2, 4, 6, 10, 12))
        head = struct.pack(">HBBB", 3 + short, asked[6], 3, short)
        return kind, asked[:4] + head + _RNG.randbytes(short)
    if kind == "late":
        return kind, asked[:1] + bytes([(asked[1] - 1) % 256]) + good[2:]
    return "nothing", b""


class Peer:
    """A server in threads of its own that answers so."""

    def __init__(self) -> None:
        self.kinds: Counter[str] = Counter()
        self.sent: set[int] = set()
        self.listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                line, _ = self.listener.accept()
                self._serve(line)

    def _serve(self, line: socket.socket) -> None:
        with line, suppress(OSError):
            while asked := line.recv(260):
                if _RNG.random() < RIGHT:
                    value = _RNG.getrandbits(31)
                    self.sent.add(value)
                    line.sendall(right(asked, value))
                    continue
                kind, frame = hostile(asked)
                self.kinds[kind] += 1
                if frame:
                    line.sendall(frame)
                if kind in ("cut", "random", "length", "nothing", "flipped", "protocol"):
                    return  # what can never become whole: no need to wait for a time-out


async def listen(peer: Peer, frames: int) -> tuple[int, int, dict[str, int]]:
    """Values that came out: all, wrong ones; and the reasons of what did not."""
    channels = {"a": ChannelSpec("a", "1"), "b": ChannelSpec("b", "1")}
    table = {
        "source": "machine", "protocol": "modbus", "port": peer.port, "period": "1 us",
        "timeout": "200 ms",
        "registers": {"a": {"address": 0, "type": "uint32"}, "b": {"address": 2, "type": "uint32"}},
    }  # fmt: skip
    source = open_live(table, SourceSpec("machine", channels, time=TimeSpec(rate=1.0)))
    source.backoff.shortest = source.backoff.longest = 1e-6  # type: ignore[attr-defined]
    source.backoff.reset()  # type: ignore[attr-defined]
    source.open()
    came = wrong = 0
    async for chunk in source.chunks():
        a, b = (int(v) for v in chunk.v[0])
        came += 1
        wrong += not (a in peer.sent and a ^ b == 0xFFFFFFFF)
        if peer.kinds.total() >= frames:
            source.close()
    return came, wrong, dict(source.health.rejected)


def main(frames: int = FRAMES) -> int:
    """Run, print the figures, and say whether they hold."""
    peer = Peer()
    began, clock = time.process_time(), time.monotonic()
    came, wrong, reasons = asyncio.run(listen(peer, frames))
    peer.listener.close()
    total = peer.kinds.total()
    print(f"hostile frames {total}, right ones {len(peer.sent)}, values out {came}, wrong {wrong}")
    for kind, count in sorted(peer.kinds.items()):
        print(f"  {kind:20} {count}")
    for reason, count in sorted(reasons.items(), key=lambda item: -item[1])[:12]:
        print(f"  rejected: {reason}: {count}")
    print(f"{time.process_time() - began:.1f} s of processor, {time.monotonic() - clock:.1f} s")
    return ended(
        {
            "no wrong value": wrong == 0,
            "frames": total >= frames,
            "the right ones come out": came > 0.5 * len(peer.sent),
        }
    )


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else FRAMES))
