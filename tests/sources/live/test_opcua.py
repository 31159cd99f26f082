"""OPC UA against a server on asyncua in a process of its own."""

from __future__ import annotations

import asyncio
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.sources.live import Around, LiveSource, open_live
from evertwin.sources.live.look import look
from evertwin.sources.live.opcua.groups import Groups
from evertwin.sources.live.opcua.source import UNREAD
from evertwin.sources.live.registry import read_settings
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from planted.draws import first_of
from tests.sources.live.peers import HERE, Proxy, free_port, listen

SPEC = SourceSpec(
    "arm", {"n": ChannelSpec("n", "1"), "x": ChannelSpec("x", "mm")}, time=TimeSpec("t")
)


def arm(port: int, spec: SourceSpec = SPEC, **settings: object) -> LiveSource:
    table = {"source": "arm", "protocol": "opcua", "url": f"opc.tcp://127.0.0.1:{port}/arm",
             "namespace": "urn:arm", "nodes": {"n": "s=n", "x": "s=x"}, "period": "20 ms",
             "timeout": 1.0, **settings}  # fmt: skip
    source = open_live(table, spec)
    source.backoff.shortest = source.backoff._bound = 0.05  # type: ignore[attr-defined]
    source.backoff.longest = 0.2  # type: ignore[attr-defined]
    return source


class Server:
    """The peer."""

    def __init__(self, folder: Path) -> None:
        self.port, self.folder = free_port(), folder
        command = [sys.executable, str(HERE / "opcua_server.py"), str(self.port)]
        self.process = subprocess.Popen(
            [*command, *certificate(folder, "machine")],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == b"ready\n"

    def say(self, *words: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{' '.join(map(str, words))}\n".encode())
        self.process.stdin.flush()


@pytest.fixture(scope="module")
def peer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("opcua"))
    yield server
    server.process.kill()
    server.process.communicate()


def certificate(folder: Path, name: str) -> tuple[str, str]:
    found, key = folder / f"{name}.der", folder / f"{name}.pem"
    use = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    made = setup_self_signed_certificate(
        key, found, f"urn:{name}", "localhost", use, {"commonName": name}
    )
    asyncio.run(made)
    return str(found), str(key)


def rows(chunks: list[Chunk]) -> dict[int, float]:
    return {int(chunk.v[0, 0]): float(chunk.v[0, 1]) for chunk in chunks}


def test_samples_with_their_stamps_and_qualities(peer: Server) -> None:
    source = arm(peer.port)
    peer.say(0, 5.0, "good")

    def speak() -> None:
        while source.health.state != "up":
            time.sleep(0.01)
        for n in range(1, 30):
            peer.say(n, 5.0, {10: "uncertain", 20: "bad"}.get(n, "good"))
            time.sleep(0.01)

    speaking = threading.Thread(target=speak)
    speaking.start()
    chunks = listen(source, lambda given: 29 in rows(given))
    speaking.join()
    came = rows(chunks)
    assert len(came) >= 25 and np.isinf(came[20]) and came[10] == came[29] == 0.005
    stamps = {int(c.v[0, 0]): int(c.t[0]) for c in chunks}
    assert stamps[29] - stamps[9] == 2 * 10**8 and stamps[9] // 10**9 == 1577836800
    assert source.health.noted == {"x: uncertain": 1, "x: bad": 1}


def test_a_line_that_is_half_open_is_left(peer: Server) -> None:
    with Proxy(peer.port) as line:
        source = arm(line.port, timeout=0.5)

        def live() -> None:
            peer.say(40, 1.0, "good")
            while source.health.state != "up":
                time.sleep(0.01)
            line.deaf = True
            while source.health.state == "up":
                time.sleep(0.01)
            line.deaf = False
            peer.say(41, 2.0, "good")

        living = threading.Thread(target=live)
        living.start()
        chunks = listen(source, lambda given: 41 in rows(given))
        living.join()
    assert rows(chunks)[41] == 0.002


def test_only_a_server_in_the_trust_folder_is_believed(peer: Server, tmp_path: Path) -> None:
    own, key = certificate(tmp_path, "twin")
    trust = tmp_path / "trust"
    trust.mkdir()
    secure = {"security": "Basic256Sha256", "certificate": own, "key": key, "trust": str(trust)}
    source = arm(peer.port, **secure)
    listen(source, lambda _: "is not in" in source.health.reason)
    (trust / "machine.der").write_bytes((peer.folder / "machine.der").read_bytes())
    peer.say(50, 3.0, "good")
    chunks = listen(arm(peer.port, **secure), lambda given: 50 in rows(given))
    assert rows(chunks)[50] == 0.003


@pytest.mark.parametrize(
    ("settings", "reason"),
    [({"namespace": "urn:nobody"}, "no namespace 'urn:nobody'"),
     ({"nodes": {"n": "s=n", "x": "s=absent"}}, "refuses ns=2;s=absent: BadNodeIdUnknown")],
)  # fmt: skip
def test_what_the_server_lacks_is_said(
    peer: Server, settings: dict[str, object], reason: str
) -> None:
    source = arm(peer.port, **settings)
    listen(source, lambda _: reason in source.health.reason)


def test_a_server_that_starts_anew_with_other_indices(
    peer: Server, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "evertwin.live")
    source = arm(peer.port)
    before = len(os.listdir("/proc/self/fd"))

    def live() -> None:
        peer.say(60, 1.0, "good")
        while source.health.state != "up":
            time.sleep(0.01)
        peer.say("restart", 3)
        peer.say(61, 2.0, "good")

    living = threading.Thread(target=live)
    living.start()
    chunks = listen(source, lambda given: 61 in rows(given), 30.0)
    living.join()
    assert rows(chunks)[61] == 0.002 and source.health.reconnects == 1
    assert source.health.lost["the line was down"] > 3
    said = [r.message for r in caplog.records if r.name == "evertwin.live"]
    assert len(said) == 3 and "down" in said[1], said
    assert len(os.listdir("/proc/self/fd")) <= before


@first_of("stall", [2.0, 5.0])
def test_after_a_stall_no_sample_is_made_up_and_the_lost_are_counted(
    peer: Server, stall: float
) -> None:
    """Both values are written with each stamp; the server's queue keeps the newest of each."""
    source, given = arm(peer.port), list[Chunk]()
    said, ended = [1000], threading.Event()

    def speak() -> None:
        while not ended.is_set():
            said[0] += 1
            peer.say(said[0], 1e3 * said[0], "good")
            time.sleep(0.005)

    async def life() -> None:
        source.open()
        stalled = 0
        async for chunk in source.chunks():
            source.committed(chunk)
            given.append(chunk)
            if len(given) == 200:
                time.sleep(stall)
                stalled = said[0]
            if stalled and chunk.v[0, 0] > stalled + 700:
                return

    speaking = threading.Thread(target=speak)
    speaking.start()
    try:
        asyncio.run(asyncio.wait_for(life(), 40))
    finally:
        ended.set()
        speaking.join()
    whole = [chunk.v[0] for chunk in given if np.isfinite(chunk.v[0]).all()]
    assert all(n == x for n, x in whole[1:])
    seen = {int(n) for n, _ in whole}
    missing = max(seen) - min(n for n in seen if n > 1000) + 1 - len(seen)
    lost = source.health.lost.get(UNREAD, 0)
    assert missing > 100 and abs(lost - missing) <= 0.2 * missing, (missing, source.health)


def test_what_the_site_file_must_say() -> None:
    for wrong, said in (
        ({"nodes": {"n": "ns=2;s=n"}}, "an index"),
        ({"security": "Basic256Sha256"}, "needs certificate, key, trust"),
    ):
        with pytest.raises(UsageError, match=said):
            arm(1, **wrong)
    with pytest.raises(UsageError, match="lack x"):
        arm(1, nodes={"n": "s=n"}).open()


def test_values_of_one_stamp_are_one_sample() -> None:
    groups = Groups(("x", "y"), 0)
    for k in range(3):
        groups.put("x", k, k, 0.0)
    groups.put("y", 7, 0, 0.0)
    assert groups.take(0.0, 0.1) == [(0, {"x": 0, "y": 7})]
    groups.put("y", 8, 2, 0.0)
    assert groups.take(0.2, 0.1) == [(1, {"x": 1, "y": 7}), (2, {"x": 2, "y": 8})]


def test_the_tree_of_a_server(peer: Server) -> None:
    table = {"source": "arm", "protocol": "opcua", "url": f"opc.tcp://127.0.0.1:{peer.port}/arm"}
    peer.say(70, 1.0, "bad")
    time.sleep(0.1)
    lines = asyncio.run(look(read_settings(table), Around()))
    assert "n  nsu=urn:arm;s=n  70.0  Good" in lines
    assert any(line.startswith("x  nsu=urn:arm;s=x") and "BadSensor" in line for line in lines)


TWIN = """schema = 1
name = "arm"
[model]
kind = "robot1d"
[[source]]
name = "arm"
[source.channels]
v = { column = "n", unit = "m/s" }
x = { column = "x", unit = "mm" }
"""
SITE = """schema = 1
name = "hall"
[[twin]]
file = "arm.toml"
[[twin.source]]
source = "arm"
protocol = "opcua"
url = "opc.tcp://127.0.0.1:PORT/arm"
namespace = "urn:arm"
nodes = { n = "s=n", x = "s=x" }
"""


def test_doctor_says_nothing_in_the_words_of_the_library(peer: Server, tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(TWIN)
    (tmp_path / "site.toml").write_text(SITE.replace("PORT", str(peer.port)))
    words = [sys.executable, "-m", "evertwin", "doctor", str(tmp_path / "site.toml")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert "nsu=urn:arm;s=x" in done.stdout and done.stderr == ""
