"""Modbus TCP against libmodbus, mbpoll, and peers that lie."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

import evertwin
from evertwin.errors import LawBroken, UsageError
from evertwin.sources.live import LiveSource, open_live
from evertwin.sources.live.modbus.source import FASTER, Modbus, blocks_of
from evertwin.sources.live.modbus.spec import Register
from evertwin.sources.live.modbus.wire import READS, Refused, Wire, WrongFrame, answer, request
from evertwin.sources.live.telling import Telling
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from planted.draws import first_of
from tests.sources.live.peers import HERE, Proxy, free_port, listen, listening, need, process

SPEC = SourceSpec("controller", {"v": ChannelSpec("speed", "m/s")}, time=TimeSpec(rate=10.0))
SPEED = {"address": 1, "type": "float32"}


def machine(port: int, spec: SourceSpec = SPEC, **settings: object) -> LiveSource:
    table = {"source": "controller", "protocol": "modbus", "port": port, "period": "10 ms",
             "timeout": "300 ms", "registers": {"speed": SPEED}, **settings}  # fmt: skip
    source = open_live(table, spec)
    source.backoff.shortest = source.backoff._bound = 0.02  # type: ignore[attr-defined]
    source.backoff.longest = 0.05  # type: ignore[attr-defined]
    return source


@contextmanager
def server(frame: Callable[[bytes], bytes | None], port: int = 0) -> Iterator[int]:
    """A server whose every answer is ``frame(request)``; none where that is None."""
    listener = socket.create_server(("127.0.0.1", port))

    def serve(line: socket.socket) -> None:
        with line, suppress(OSError):
            while asked := line.recv(260):
                said = frame(asked)
                if said is not None:
                    line.sendall(said)

    def accept() -> None:
        with suppress(OSError):
            while True:
                line, _ = listener.accept()
                threading.Thread(target=serve, args=(line,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield listener.getsockname()[1]
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def right(asked: bytes, value: float = 7.5) -> bytes:
    return asked[:4] + struct.pack(">HBBBf", 7, asked[6], asked[7], 4, value)


@pytest.mark.parametrize("function", [0, 5, 6, 7, 8, 15, 16, 20, 21, 22, 23, 43, 128, 255])
def test_no_function_that_writes_can_be_sent(function: int) -> None:
    with pytest.raises(LawBroken, match="only 1 to 4"):
        request(1, 1, function, 0, 1)


def test_every_byte_that_is_sent_is_a_request_to_read() -> None:
    sent = []

    def frame(asked: bytes) -> bytes:
        sent.append(asked)
        return right(asked)

    tables = {"a": {"address": 0, "table": "coil"}, "b": {"address": 0, "table": "discrete"},
              "c": {"address": 0, "table": "input"}, "speed": SPEED}  # fmt: skip
    with server(frame) as port:
        for column in tables:
            spec = SourceSpec("controller", {"v": ChannelSpec(column, "1")}, time=SPEC.time)
            count = len(sent)
            source = machine(port, spec, registers={column: tables[column]})
            listen(source, lambda _, count=count: len(sent) > count)  # type: ignore[misc]
    assert {asked[7] for asked in sent} == set(READS.values()) and {len(a) for a in sent} == {12}
    package = Path(evertwin.__file__).parent / "sources" / "live" / "modbus"
    sends = [
        path.name for path in sorted(package.glob("*.py"))
        for _ in re.findall(r"\b(?:send\w*|sock_send\w*|write)\(", path.read_text())
    ]  # fmt: skip
    assert sends == ["wire.py"]  # bytes go out in one place


WRONG: dict[str, Callable[[bytes], bytes | None]] = {
    "another transaction": lambda a: b"\xff\xee" + right(a)[2:],
    "another protocol": lambda a: right(a)[:2] + b"\x00\x01" + right(a)[4:],
    "an impossible length": lambda a: right(a)[:4] + b"\xff\xff" + right(a)[6:],
    "another unit": lambda a: right(a)[:6] + b"\x09" + right(a)[7:],
    "another function": lambda a: right(a)[:7] + b"\x04" + right(a)[8:],
    "another count": lambda a: right(a)[:8] + b"\x02" + right(a)[9:],
    "another length": lambda a: right(a) + b"\x00",
}


@pytest.mark.parametrize("reason", WRONG)
def test_a_wrong_frame_is_a_reason_and_never_a_value(reason: str) -> None:
    with server(WRONG[reason]) as port:
        source = machine(port)
        assert listen(source, lambda _: sum(source.health.rejected.values()) >= 2) == []
    rejected = source.health.rejected
    assert set(rejected) == {f"a wrong frame: {reason}"}


def test_fewer_registers_in_a_frame_that_is_otherwise_right() -> None:
    short = struct.pack(">HHHBBBH", 5, 0, 5, 1, 3, 2, 99)
    with pytest.raises(WrongFrame, match="count"):
        answer(short, 5, 1, 3, 2)


def test_an_exception_is_a_reason_and_the_line_stays() -> None:
    lines = []
    with server(lambda a: lines.append(a) or a[:4] + struct.pack(">HBBB", 3, 1, 0x83, 6)) as port:
        source = machine(port)
        assert listen(source, lambda _: len(lines) > 3) == []
    assert list(source.health.rejected) == ["exception 6: device busy"]
    assert [a[:2] for a in lines][:3] == [b"\0\1", b"\0\2", b"\0\3"] and str(Refused(1))


def test_a_late_answer_is_never_taken_for_another() -> None:
    values = iter(range(1000))

    def late(asked: bytes) -> bytes:
        value = next(values)
        if value % 3 == 1:
            time.sleep(0.08)
        return right(asked, value)

    with server(late) as port:
        source = machine(port, timeout=0.04)
        chunks = listen(source, lambda given: len(given) >= 8)
    seen = [float(chunk.v[0, 0]) for chunk in chunks]
    assert all(v % 3 != 1 for v in seen) and seen == sorted(set(seen))
    assert source.health.reconnects >= 2 and source.health.reason == "no answer in time"


def test_sequence_decides_what_is_one_sample() -> None:
    said = iter([1, 1.0, 2, 2, 3.0, 3, 3, 3, 4.0, 4])  # before, value, after; torn twice
    with server(lambda a: right(a, next(said, 9))) as port:
        registers = {"speed": SPEED, "n": {"address": 5, "type": "float32"}}
        source = machine(port, registers=registers, sequence="n", timeout="10 s")
        chunks = listen(source, lambda given: len(given) >= 1)
    assert chunks[0].v.tolist() == [[3.0]]


@first_of("seed", range(5))
def test_a_gap_of_the_sequence_is_a_counted_loss(seed: int) -> None:
    """Also where the line was down, or half open; what the machine did not make is none."""
    rng, asked, n, phase = np.random.default_rng(seed), [0], [0], [0]

    def counts(a: bytes) -> bytes | None:
        asked[0] += 1
        if asked[0] == 31:
            n[0], phase[0] = n[0] + 7, 0
            return None  # the line is half open for a while
        alone = a[8:10] == b"\0\3"
        if alone and phase[0] == 0:
            n[0] += 1 + (int(rng.integers(0, 5)) if asked[0] > 12 else 0)
        phase[0] = 0 if alone and phase[0] == 1 else int(not alone)
        said = struct.pack(">f", n[0]) * (1 if alone else 2)
        return a[:4] + struct.pack(">HBBB", 3 + len(said), a[6], a[7], len(said)) + said

    with server(counts) as port:
        registers = {"speed": SPEED, "n": {"address": 3, "type": "float32"}}
        source = machine(port, registers=registers, sequence="n")
        chunks = listen(source, lambda given: len(given) >= 25)
    numbers = [int(chunk.v[0, 0]) for chunk in chunks]
    missing = numbers[-1] - numbers[0] + 1 - len(numbers)
    lost = source.health.lost
    assert source.health.losses == missing > 5 and "the line was down" in lost
    assert set(lost) == {"the line was down", FASTER}


def test_a_clock_for_a_sequence_counts_nothing() -> None:
    said = [n for n in range(0, 4000, 50) for _ in range(4)]
    numbers = iter(said)
    with server(lambda a: right(a, float(next(numbers, 9999.0)))) as port:
        registers = {"speed": SPEED, "n": {"address": 5, "type": "float32"}}
        source = machine(port, registers=registers, sequence="n")
        listen(source, lambda given: len(given) >= 20)
    assert source.health.losses == 0


@first_of("rate", [100, 400])
def test_a_machine_that_is_read_too_seldom_is_known_to_lose_samples(rate: int) -> None:
    """No two that are read follow each other: that it counts is seen while one is read."""
    began = time.monotonic()

    def counts(a: bytes) -> bytes:
        said = struct.pack(">f", int((time.monotonic() - began) * rate)) * (a[11] // 2)
        return a[:4] + struct.pack(">HBBB", 3 + len(said), a[6], a[7], len(said)) + said

    with server(counts) as port:
        registers = {"speed": SPEED, "n": {"address": 3, "type": "float32"}}
        source = machine(port, registers=registers, sequence="n", period="50 ms")
        chunks = listen(source, lambda given: len(given) >= 100)
    numbers = [int(chunk.v[0, 0]) for chunk in chunks]
    missing = numbers[-1] - numbers[0] + 1 - len(numbers)
    assert missing > 200 and abs(source.health.losses - missing) <= numbers[1] - numbers[0]
    assert set(source.health.lost) == {FASTER}


def test_swapped_words_are_named(caplog: pytest.LogCaptureFixture) -> None:
    with server(lambda a: right(a, 42.5)) as port:
        source = machine(port, registers={"speed": {**SPEED, "word_order": "little"}})
        listen(source, lambda given: len(given) >= 3)
    said = "speed is of no size that machines have: try word_order = 'big'"
    assert list(source.health.noted) == [said]
    assert "it would be 42.5" in source.health.hint
    assert len(caplog.records) == 1 and source.health.hint in caplog.text


def test_what_the_map_lacks_is_said_before_anything_is_connected() -> None:
    spec = SourceSpec("controller", SPEC.channels, time=TimeSpec("t"))
    with pytest.raises(UsageError, match=r"lack t: .* stamp = 'arrival'"):
        machine(1, spec).open()
    with pytest.raises(UsageError, match="another quantity"):
        machine(1, registers={"speed": {**SPEED, "unit": "kg"}})


def test_blocks_hold_at_most_what_an_answer_carries() -> None:
    blocks = blocks_of([Register(i, "float32") for i in range(0, 400, 2)])
    assert [block.length for block in blocks] == [124, 124, 124, 28]
    assert blocks_of([Register(0), Register(0, "float32")])[0].length == 2


def test_a_machine_that_flaps_leaves_nothing_behind(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "evertwin.live")
    with server(right) as port, Proxy(port) as line:
        source = machine(line.port)
        before = len(os.listdir("/proc/self/fd"))

        def until(state: str) -> None:
            end = time.monotonic() + 10.0
            while source.health.state != state and time.monotonic() < end:
                time.sleep(0.01)

        def flap() -> None:
            for _ in range(8):
                until("up")
                line.refuse = True
                line.cut()
                until("down")
                line.refuse = False
            until("up")

        flapping = threading.Thread(target=flap)
        flapping.start()
        listen(source, lambda given: not flapping.is_alive(), 60.0)
        time.sleep(0.1)
        assert len(os.listdir("/proc/self/fd")) <= before
    health = source.health
    downs = [r for r in caplog.records if "down:" in r.message]
    ups = [r for r in caplog.records if r.message.startswith("controller: up")]
    assert health.reconnects == 8 and len(ups) == 9 and len(downs) == 8
    assert health.losses > 0


def test_why_the_line_was_down_is_no_reason_once_it_is_up() -> None:
    told = Telling("controller")
    told.up()
    told.down("no answer in time")
    assert told.health.to_dict()["reason"] == "no answer in time"
    told.up()
    assert told.health.to_dict()["reason"] == "" and told.health.reason == "no answer in time"
    told.reject("a wrong frame")
    assert told.health.to_dict()["reason"] == "a wrong frame"


def test_half_open_line_is_left_after_the_timeout() -> None:
    with server(right) as port, Proxy(port) as line:
        source = machine(line.port)

        def spoil() -> None:
            time.sleep(0.2)
            line.deaf = True
            time.sleep(0.6)
            line.deaf = False

        spoiling = threading.Thread(target=spoil)
        spoiling.start()
        came = listen(
            source,
            lambda given: not spoiling.is_alive()
            and source.health.state == "up" and source.health.reconnects > 0,
        )  # fmt: skip
    gaps = np.diff([int(chunk.t[0]) for chunk in came])
    assert gaps.max() > 0.4e9 and (gaps > 0).all()


def test_a_peer_that_comes_late_is_found(caplog: pytest.LogCaptureFixture) -> None:
    port = free_port()
    source = machine(port)

    async def both() -> None:
        source.open()
        reading = asyncio.create_task(anext(aiter(source.chunks())))
        while source.health.state != "down":
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.2)
        assert source.health.reason.endswith("refused")

        with server(right, port):
            chunk = await asyncio.wait_for(reading, 5.0)
            assert chunk.v.tolist() == [[7.5]]
            source.close()

    asyncio.run(both())
    assert len([r for r in caplog.records if r.levelno >= logging.WARNING]) == 1


@pytest.fixture(scope="module")
def libmodbus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("gcc")
    if not Path("/usr/include/modbus/modbus.h").exists():
        pytest.skip("peer absent: libmodbus-dev is not installed")
    program = tmp_path_factory.mktemp("peer") / "server"
    made = subprocess.run(
        ["gcc", "-O1", "-I/usr/include/modbus", str(HERE / "server.c"), "-lmodbus", "-o",
         str(program)], capture_output=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    return program


COLUMNS = {
    "n": {"address": 0},
    "speed": SPEED,
    "big": {"address": 3, "type": "int64"},
    "swapped": {"address": 7, "type": "float32", "word_order": "little"},
    "none": {"address": 9, "type": "int16", "sentinels": [0x8000]},
    "far": {"address": 259},
    "mm": {"address": 100, "unit": "mm", "scale": 10},
    "bit": {"address": 3, "bit": 15},
    "coil": {"address": 1, "table": "coil"},
    "input": {"address": 3, "table": "discrete"},
    "ms": {"address": 0, "type": "uint32", "table": "input"},
    "twice": {"address": 260, "type": "float32"},
}


def all_of_them() -> SourceSpec:
    units = {"mm": "m"}
    channels = {name: ChannelSpec(name, units.get(name, "1")) for name in COLUMNS}
    return SourceSpec("controller", channels, time=TimeSpec("ms", "ms"))


@pytest.mark.system
def test_libmodbus_is_read_as_mbpoll_reads_it(libmodbus: Path) -> None:
    need("mbpoll")
    port = free_port()
    with process(port, str(libmodbus), str(port)) as peer:
        source = machine(port, all_of_them(), registers=COLUMNS, sequence="n")
        chunks = listen(source, lambda given: len(given) >= 20)
        names = list(COLUMNS)
        table = np.concatenate([chunk.v for chunk in chunks])
        row = dict(zip(names, table[0], strict=True))
        assert (row["speed"], row["big"], row["swapped"]) == (42.5, -5e12, -1.25)
        assert np.isinf(row["none"]) and row["far"] == 259 and row["mm"] == 1.0
        assert (row["bit"], row["coil"], row["input"]) == (1, 1, 1)
        assert (table[:, names.index("n")] == table[:, names.index("twice")]).all()
        assert (np.diff(table[:, names.index("n")]) > 0).all()
        for kind, first, column in (("4:float", 2, "speed"), ("4", 260, "far")):
            said = subprocess.run(
                ["mbpoll", "-m", "tcp", "-a", "1", "-0", "-r", str(first - 1), "-c", "1", "-t",
                 kind, "-B", "-1", "-p", str(port), "127.0.0.1"],
                capture_output=True, text=True, check=True,
            ).stdout  # fmt: skip
            found = re.search(r"\[\d+\]:\s+(\S+)", said)
            assert found and float(found[1]) == row[column], said
        peer.kill()


@pytest.mark.system
def test_a_machine_that_never_stands_still_is_no_sample(libmodbus: Path) -> None:
    port = free_port()
    with process(port, str(libmodbus), str(port), "1"):
        source = machine(port, all_of_them(), registers=COLUMNS, sequence="n")
        assert listen(source, lambda _: bool(source.health.rejected)) == []
    assert list(source.health.rejected) == ["n changed during each of 3 readings"]


@pytest.mark.system
def test_a_machine_that_is_killed_and_comes_back(libmodbus: Path) -> None:
    port = free_port()
    with process(port, str(libmodbus), str(port)) as peer:
        source = machine(port, all_of_them(), registers=COLUMNS)
        again: list[subprocess.Popen[bytes]] = []

        def restart() -> None:
            time.sleep(0.2)
            peer.kill()
            peer.wait()
            time.sleep(0.2)
            again.append(subprocess.Popen([str(libmodbus), str(port)]))
            listening(port)

        restarting = threading.Thread(target=restart)
        restarting.start()
        listen(source, lambda given: source.health.reconnects == 1 and len(given) > 20)
        restarting.join()
        again[0].kill()
        again[0].wait()
    assert sys.platform != "linux" or source.health.lost["the line was down"] > 5


def test_a_wire_knows_bytes_that_nobody_asked_for() -> None:
    async def ask() -> None:
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        wire = Wire(0.5)
        wire._socket = ours
        theirs.sendall(b"x")
        with theirs, pytest.raises(WrongFrame, match="nobody asked"):
            await wire.read(1, "holding", 0, 1)
        assert wire._socket is None
        await asyncio.sleep(0)

    asyncio.run(ask())
    assert Modbus.settings.__name__ == "ModbusSettings"
