"""MQTT against mosquitto: what is acknowledged is stored, what was not stored comes again."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import socket
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import paho.mqtt.client as paho
import pytest

from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.sources.live import LiveSource, open_live
from evertwin.sources.live.mqtt.parts import Count, NoMessage, place
from evertwin.sources.spec import ArraySpec, ChannelSpec, SourceSpec, TimeSpec
from planted.draws import first_of
from tests.sources.live.peers import Proxy, free_port, hear, listen, listening, need

SPEC = SourceSpec(
    "robot", {"x": ChannelSpec("x", "m"), "q": ChannelSpec("q", "deg")}, time=TimeSpec("t", "ms")
)
COLUMNS = {"x": "pose.x", "q": {"path": "q.0"}}


def robot(port: int, spec: SourceSpec = SPEC, **settings: object) -> LiveSource:
    table = {"source": "robot", "protocol": "mqtt", "port": port, "topic": "robot/state",
             "sequence": "n", "client": "twin", "timeout": 2.0, "columns": COLUMNS,
             **settings}  # fmt: skip
    source = open_live(table, spec)
    source.backoff.shortest = source.backoff._bound = 0.02  # type: ignore[attr-defined]
    source.backoff.longest = 0.1  # type: ignore[attr-defined]
    return source


def said(n: int) -> bytes:
    return json.dumps({"t": 10 * n, "n": n, "pose": {"x": n}, "q": [n, 0]}).encode()


class Broker:
    """A mosquitto that can be killed and started again."""

    def __init__(self, folder: Path, *lines: str) -> None:
        self.port = free_port()
        self.config = folder / "mosquitto.conf"
        own = [f"listener {self.port} 127.0.0.1", "allow_anonymous true", "user root",
               f"persistence_location {folder}/"]  # fmt: skip
        self.config.write_text("\n".join([*own, *lines]) + "\n")
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            ["mosquitto", "-c", str(self.config)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        listening(self.port)

    def stop(self, *, kill: bool = False) -> None:
        while self.process.poll() is None:
            (self.process.kill if kill else self.process.terminate)()
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(1.0)  # it misses a signal that comes as it begins to wait

    def publish(self, messages: list[bytes], topic: str = "robot/state") -> None:
        subprocess.run(
            ["mosquitto_pub", "-p", str(self.port), "-t", topic, "-q", "1", "-l", "-V", "5"],
            input=b"\n".join(messages) + b"\n", check=True, timeout=20,
        )  # fmt: skip


@contextmanager
def mosquitto(folder: Path, *lines: str) -> Iterator[Broker]:
    need("mosquitto", "mosquitto_pub")
    broker = Broker(folder, *lines)
    try:
        yield broker
    finally:
        broker.stop(kill=True)


def numbers(chunks: list[Chunk]) -> list[int]:
    return [int(chunk.v[0, 0]) for chunk in chunks]


SAFE = ("persistence true", "autosave_on_changes true", "autosave_interval 1")


@pytest.mark.system
@pytest.mark.parametrize("version", [3, 5])
def test_what_was_not_stored_comes_again(tmp_path: Path, version: int) -> None:
    with mosquitto(tmp_path) as broker:
        source = robot(broker.port, version=version)

        async def one_that_stores_nothing() -> list[Chunk]:
            source.open()
            given = []
            async for chunk in source.chunks():
                if not given:
                    source.committed(chunk)
                given.append(chunk)
                if len(given) == 12:
                    return given
            return given

        async def run() -> list[Chunk]:
            reading = asyncio.create_task(one_that_stores_nothing())
            while source.health.state != "up":
                await asyncio.to_thread(broker.publish, [said(0)])
                await asyncio.sleep(0.02)
            await asyncio.to_thread(broker.publish, [said(n) for n in range(1, 12)])
            return await asyncio.wait_for(reading, 10)

        first = asyncio.run(run())
        broker.publish([said(n) for n in range(12, 40)])
        again = robot(broker.port, version=version)
        again.resume(int(first[5].t[0]))  # the store had six of them
        rest = listen(again, lambda given: len(given) >= 34)
    assert numbers(first) == list(range(12)) and numbers(rest) == list(range(6, 40))
    np.testing.assert_allclose(rest[0].v[0], [6, np.deg2rad(6)])
    assert again.health.losses == 0 and again.health.repeated >= 5


@pytest.mark.system
@pytest.mark.parametrize("inflight", [2, 5, 20])
def test_a_clock_set_back_before_a_restart_stops_no_broker(tmp_path: Path, inflight: int) -> None:
    with mosquitto(tmp_path, f"max_inflight_messages {inflight}") as broker:
        first = robot(broker.port)

        def publish() -> None:
            while first.health.state == "connecting":
                broker.publish([said(0)])

        publishing = threading.Thread(target=publish)
        publishing.start()
        listen(first, bool)
        publishing.join()
        broker.publish([said(n) for n in range(1, 60)])
        again = robot(broker.port)
        again.resume(3600 * 10**9)  # what was stored is an hour ahead of all that comes
        rest = listen(again, lambda given: 59 in numbers(given), 30.0)
    assert numbers(rest)[-59:] == list(range(1, 60))
    stamps = np.concatenate([chunk.t for chunk in rest])
    assert stamps[0] > 3600 * 10**9 and (np.diff(stamps) > 0).all()
    assert again.health.noted == {"the clock was set": 1} and not again.health.losses


@pytest.mark.system
def test_a_broker_that_is_stopped_and_comes_back_loses_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "evertwin.live")
    with mosquitto(tmp_path, *SAFE) as broker:
        source = robot(broker.port)
        before = set(os.listdir("/proc/self/fd"))

        def life() -> None:
            while source.health.state != "up":
                broker.publish([said(0)])
            for part in range(1, 4):
                broker.stop()
                broker.start()
                broker.publish([said(n) for n in range(100 * part - 99, 100 * part + 1)])

        living = threading.Thread(target=life)
        living.start()
        chunks = listen(source, lambda given: len(given) >= 301)
        living.join()
        assert len(os.listdir("/proc/self/fd")) <= len(before)
    assert sorted(numbers(chunks)) == list(range(301))
    health = source.health
    assert health.losses == 0 and health.reconnects == 3 and not health.rejected
    assert [r.levelname for r in caplog.records].count("WARNING") == 3


def sent(n: int, ts: float, number: object) -> bytes:
    return json.dumps({"t": 1000 * ts, "n": number, "pose": {"x": n}, "q": [n, 0]}).encode()


@pytest.mark.system
@pytest.mark.parametrize("numbered", [True, False])
@first_of("count", [3, 20])
def test_a_gateway_s_backlog_is_late_and_not_lost(
    tmp_path: Path, count: int, numbered: bool
) -> None:
    """5 s apart, so that all of them are far behind: sent after the newest, as gateways do."""
    order = [*range(40), *range(40 + count, 64), *range(40, 40 + count), *range(64, 90)]
    more = {} if numbered else {"sequence": None}
    with mosquitto(tmp_path) as broker:
        source = robot(broker.port, **more)

        def life() -> None:
            while source.health.state != "up":
                broker.publish([sent(0, 0.0, 0)])
            client = paho.Client(paho.CallbackAPIVersion.VERSION2)
            client.connect("127.0.0.1", broker.port)
            client.loop_start()
            for k, n in enumerate(order[1:], start=1):
                client.publish("robot/state", sent(n, 5.0 * n, n), qos=1)
                if not 64 - count <= k < 64:  # the machine takes its time, the gateway does not
                    time.sleep(0.05)
            client.loop_stop()

        living = threading.Thread(target=life)
        living.start()
        chunks = listen(source, lambda given: 89 in numbers(given), 20.0)
        living.join()
    stamps = {int(chunk.v[0, 0]): int(chunk.t[0]) for chunk in chunks}
    assert stamps == {n: 5 * n * 10**9 for n in range(90)} and len(chunks) == 90
    health = source.health
    assert health.losses == 0 and not health.rejected
    assert set(health.noted) == {"came late"} and health.noted["came late"] >= count - 2


@pytest.mark.system
def test_the_number_of_a_message_that_is_refused_tells_of_no_loss(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        source = robot(broker.port)

        def life() -> None:
            while source.health.state != "up":
                broker.publish([sent(0, 0.0, 0)])
            stampless = b'{"n": 99999, "t": "?", "pose": {"x": 1}, "q": [1]}'
            wrong = {10: stampless, 20: sent(20, 2.0, 10**6)}
            broker.publish([wrong.get(n, sent(n, n / 10, n)) for n in range(1, 40) if n != 30])

        living = threading.Thread(target=life)
        living.start()
        chunks = listen(source, lambda given: 39 in numbers(given))
        living.join()
    assert numbers(chunks) == [n for n in range(40) if n not in (10, 30)]
    assert source.health.losses == 1 and sum(source.health.rejected.values()) == 1


@pytest.mark.system
def test_a_broker_that_forgets_is_named_as_the_cause(tmp_path: Path) -> None:
    with mosquitto(tmp_path, "persistence false") as broker:
        source = robot(broker.port)

        def life() -> None:
            while source.health.state != "up":
                broker.publish([said(0)])
            source.backoff.shortest = source.backoff._bound = 3.0  # type: ignore[attr-defined]
            source.backoff.longest = 3.0  # type: ignore[attr-defined]
            broker.stop(kill=True)
            broker.start()
            broker.publish([said(n) for n in range(1, 20)])  # nobody is there
            while source.health.reconnects == 0 and not done.is_set():
                broker.publish([said(50)])

        done = threading.Event()
        living = threading.Thread(target=life)
        living.start()
        chunks = listen(source, lambda given: 50 in numbers(given))
        done.set()
        living.join()
    health = source.health
    assert health.losses == 51 - len(chunks) > 0
    assert all("forgot the session" in cause for cause in health.lost)
    assert list(health.noted) == list(health.lost)


@pytest.mark.system
def test_a_queue_that_is_full_is_named_as_the_cause(tmp_path: Path) -> None:
    with mosquitto(tmp_path, "max_queued_messages 10") as broker:
        source = robot(broker.port)

        async def life() -> list[Chunk]:
            given: list[Chunk] = []
            source.open()

            async def read() -> None:
                async for chunk in source.chunks():
                    given.append(chunk)
                    source.committed(chunk)

            reading = asyncio.create_task(read())
            while source.health.state != "up":
                await asyncio.to_thread(broker.publish, [said(0)])
            line = source._line  # type: ignore[attr-defined]
            source.backoff.shortest = source.backoff._bound = 3.0  # type: ignore[attr-defined]
            source.backoff.longest = 3.0  # type: ignore[attr-defined]
            line.client.disconnect()
            await asyncio.to_thread(broker.publish, [said(n) for n in range(1, 100)])
            while source.health.reconnects == 0:
                await asyncio.sleep(0.02)
            await asyncio.to_thread(broker.publish, [said(100)])
            while 100 not in numbers(given):
                await asyncio.sleep(0.02)
            source.close()
            await reading
            return given

        chunks = asyncio.run(asyncio.wait_for(life(), 15))
    health = source.health
    assert health.losses == 101 - len(chunks) > 50
    assert any("max_queued_messages" in cause for cause in health.lost)


@pytest.mark.parametrize("answers", [False, True], ids=["silent", "closes"])
def test_a_broker_that_does_not_know_mqtt_5_is_named(*, answers: bool) -> None:
    """As brokers of 3.1.1 do: they say nothing at all, or close the line."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def closes() -> None:
            with suppress(OSError):
                while True:
                    server.accept()[0].close()

        if answers:
            threading.Thread(target=closes, daemon=True).start()
        source = robot(server.getsockname()[1], timeout=0.3)
        listen(source, lambda _: "version = 3" in source.health.reason)


@pytest.mark.system
def test_hostile_and_retained_messages_are_counted_and_forgotten(tmp_path: Path) -> None:
    bad = [b"{", b"\xff\xfe", b"[" * 100_000, b"9" * 6000, b"{}", b'{"t": "x", "pose": {"x": 1}}',
           b'{"t": 5, "n": "x", "pose": 7, "q": {"0": {}}}', b"null", b"NaN"]  # fmt: skip
    with mosquitto(tmp_path) as broker:
        old = ["mosquitto_pub", "-p", str(broker.port), "-t", "robot/state", "-r", "-m", "{}"]
        subprocess.run(old, check=True)
        source = robot(broker.port)

        def publish() -> None:
            while source.health.state == "connecting":
                broker.publish([said(1)])
            broker.publish([*bad, said(2)])

        publishing = threading.Thread(target=publish)
        publishing.start()
        chunks = listen(source, lambda given: 2 in numbers(given))
        publishing.join()
    assert numbers(chunks) == [1, 2]
    rejected = source.health.rejected
    assert rejected["a retained message: an old value"] == 1  # type: ignore[index]
    assert rejected["a message that is not JSON"] == 4 and rejected["no stamp"] == 4  # type: ignore[index]


@pytest.mark.system
def test_what_is_kept_out_here_is_not_lost_elsewhere(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker:
        source = robot(broker.port)

        def publish() -> None:
            while source.health.state == "connecting":
                broker.publish([said(1)])
            broker.publish([b"{" if n % 4 else said(n) for n in range(2, 41)])
            broker.publish([said(n) for n in range(41, 46)], "robot/stat")
            broker.publish([said(46)])

        publishing = threading.Thread(target=publish)
        publishing.start()
        listen(source, lambda given: 46 in numbers(given))
        publishing.join()
    assert source.health.rejected == {"a message that is not JSON": 29}
    (cause,) = source.health.lost
    assert source.health.losses == 5 and "published elsewhere" in cause


@pytest.mark.system
def test_a_topic_on_which_nothing_comes_is_said_with_what_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("evertwin.sources.live.mqtt.source.SILENT", 0.3)
    monkeypatch.setattr("evertwin.sources.live.mqtt.source.LISTEN", 1.0)
    with mosquitto(tmp_path) as broker:
        source = robot(broker.port, topic="robot/stat")
        ends = threading.Event()

        def publish() -> None:
            while not ends.wait(0.1):
                broker.publish([said(1)])
                broker.publish([said(1)], "shop/lamp")

        publishing = threading.Thread(target=publish)
        publishing.start()
        listen(source, lambda given: "sends" in source.health.reason, 20.0)
        ends.set()
        publishing.join()
    assert source.health.reason == (
        "nothing came on robot/stat in 0 s; what the broker sends: robot/state, shop/lamp"
    )
    assert len(caplog.records) == 1 and not source.health.received


@pytest.mark.system
def test_plain_values_of_several_topics(tmp_path: Path) -> None:
    spec = SourceSpec("robot", SPEC.channels, time=TimeSpec(rate=1.0))
    columns = {"x": {"topic": "robot/x"}, "q": {"topic": "robot/q"}}
    with mosquitto(tmp_path) as broker:
        source = robot(broker.port, spec, columns=columns, sequence=None)

        def publish() -> None:
            while source.health.state == "connecting":
                broker.publish([b"1.5"], "robot/x")
            broker.publish([b"180"], "robot/q")

        publishing = threading.Thread(target=publish)
        publishing.start()
        chunks = listen(source, lambda given: bool(np.isfinite([c.v[0, 1] for c in given]).any()))
        publishing.join()
    assert chunks[0].v[0, 0] == 1.5 and np.isnan(chunks[0].v[0, 1])
    assert chunks[-1].v[0, 1] == np.pi


@pytest.mark.system
def test_users_and_refusals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need("mosquitto_passwd")
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), "twin", "secret"], check=True)
    with mosquitto(tmp_path) as broker:
        text = broker.config.read_text().replace("anonymous true", "anonymous false")
        broker.config.write_text(f"{text}password_file {passwords}\n")
        broker.stop()
        broker.start()
        monkeypatch.setenv("ROBOT_PASSWORD", "wrong")
        source = robot(broker.port, user="twin", password_env="ROBOT_PASSWORD")
        listen(source, lambda given: "ot authorized" in source.health.reason)
        (tmp_path / "password").write_text("secret\n")
        password = str(tmp_path / "password")
        right = robot(broker.port, user="twin", password_file=password, will="robot/twin")

        def told(_: list[Chunk]) -> bool:
            return right._line is not None  # type: ignore[attr-defined]

        listen(right, told)
        said_of = subprocess.run(
            ["mosquitto_sub", "-p", str(broker.port), "-u", "twin", "-P", "secret", "-t",
             "robot/twin", "-C", "1", "-W", "5"], capture_output=True, check=True,
        )  # fmt: skip
        assert said_of.stdout == b"up\n"


def test_what_the_site_file_must_say() -> None:
    with pytest.raises(UsageError, match="wildcards"):
        robot(1, topic="robot/#").open()
    with pytest.raises(UsageError, match="no stamp in common"):
        robot(1, columns={"x": {"topic": "a"}}).open()
    with pytest.raises(UsageError, match="EVERTWIN_NO_SUCH is not set"):
        robot(1, password_env="EVERTWIN_NO_SUCH").open()
    with pytest.raises(UsageError, match="cannot be read"):
        robot(1, password_file="no/such").open()
    names = {robot(port, client="")._name() for port in (1, 2)}  # type: ignore[attr-defined]
    assert len(names) == 2


def test_messages_and_counts() -> None:
    with pytest.raises(NoMessage, match="too large"):
        place(b" " * (1 << 21), ["x"])
    count = Count()
    restart = [count.missing(n, None) for n in (500, 501, 0, 1, 4)]
    assert restart == [0, 0, 0, 0, 2] and count.starts == 1
    assert count.missing("x", None) == 0 and count.missing(float("nan"), None) == 0


@pytest.mark.parametrize("seed", range(30))
def test_what_comes_late_was_not_lost_and_a_wrong_number_tells_of_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sent = np.flatnonzero(rng.random(600) > 0.05)
    late = np.sort(sent + np.where(rng.random(len(sent)) < 0.1, rng.integers(0, 40, len(sent)), 0))
    order = sent[np.argsort(late, kind="stable")].tolist()
    newest = np.maximum.accumulate(order)
    fresh = np.flatnonzero(np.diff(newest) > 0)[1:-50] + 1
    wrong = set(rng.choice(fresh, 5, replace=False).tolist())
    count, lost, most = Count(), 0, 0
    for k, number in enumerate(order):
        far = int(rng.integers(5000, 99_999))
        lost += count.missing(far if k in wrong else number, None, refused=k % 2 == 0)
        most = max(most, 0 if k in wrong else lost)
    began = order[0]
    assert lost == max(order) - began + 1 - sum(number >= began for number in order)
    assert most < 100 and count.starts == 0


def test_what_comes_late_after_a_leap_is_found_again_by_its_own_cause() -> None:
    """A broker that starts again may send its newest message before all that it had queued."""
    count, lost = Count(), Counter[str]()
    for number in (416, 417, 1418, *range(418, 1418), 1419):
        missing = count.missing(number, None, "queue" if number == 1418 else "")
        lost[count.cause] += missing
    assert +lost == Counter() and -lost == Counter()


@pytest.mark.system
def test_a_line_that_is_half_open_is_left(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker, Proxy(broker.port) as line:
        source = robot(line.port, keepalive=1)

        async def life() -> list[Chunk]:
            hearing = asyncio.create_task(hear(source, lambda given: 7 in numbers(given)))
            while source.health.state != "up":
                await asyncio.to_thread(broker.publish, [said(1)])
                await asyncio.sleep(0.05)
            line.deaf = True
            while source.health.state == "up":
                await asyncio.sleep(0.05)
            line.deaf = False
            await asyncio.to_thread(broker.publish, [said(7)])
            return await hearing

        chunks = asyncio.run(asyncio.wait_for(life(), 20))
    assert numbers(chunks) == [1, 7] and source.health.lost


@pytest.mark.system
def test_scans_are_arrays(tmp_path: Path) -> None:
    spec = ArraySpec("scan", (3,), column="ranges", time=TimeSpec("t", "s"))
    with mosquitto(tmp_path) as broker:
        table = {"source": "scan", "protocol": "mqtt", "port": broker.port, "topic": "robot/scan"}

        def scan(t: float, *ranges: object) -> bytes:
            return json.dumps({"t": t, "ranges": ranges}).encode()

        async def run() -> tuple[list[Chunk], LiveSource]:
            source = open_live(table, spec)
            hearing = asyncio.create_task(hear(source, lambda given: len(given) >= 2))
            while source.health.state != "up":
                await asyncio.to_thread(broker.publish, [scan(1.0, 1, 2, 3)], "robot/scan")
                await asyncio.sleep(0.05)
            said = [scan(2.0, 1, 2), b'{"t": 2.5, "ranges": 7}', scan(2.6, 1, "far", 3),
                    scan(3.0, 4, None, 6)]  # fmt: skip
            await asyncio.to_thread(broker.publish, said, "robot/scan")
            return await hearing, source

        given, source = asyncio.run(run())
    np.testing.assert_array_equal(given[-1].v, [[4.0, np.nan, 6.0]])
    assert given[0].v.tolist() == [[1.0, 2.0, 3.0]]
    assert source.health.rejected == {"expected 3 numbers in ranges": 3}
    with pytest.raises(UsageError, match="modbus gives no arrays"):
        open_live({"source": "scan", "protocol": "modbus", "host": "127.0.0.1", "registers": {
            "ranges": {"address": 1}}}, spec)  # fmt: skip
