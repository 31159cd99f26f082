"""MQTT over TLS against mosquitto: each wrong certificate is refused by name, on either side."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from evertwin.fold import Chunk
from evertwin.publishers.contract import About, News
from evertwin.publishers.mqtt import MqttOut
from evertwin.publishers.mqtt_spec import MqttOutSettings
from tests.sources.live.peers import free_port, listen, listening, need
from tests.sources.live.pki import Authority
from tests.sources.live.test_mqtt import Broker, mosquitto, numbers, robot, said

pytestmark = pytest.mark.system
HOSTS = {"good": ("127.0.0.1", (-1, 1)), "elsewhere": ("127.0.0.9", (-1, 1)),
         "expired": ("127.0.0.1", (-9, -2))}  # fmt: skip


class Hall(NamedTuple):
    """A broker with a listener for each certificate, and what a client may bring."""

    broker: Broker
    ports: dict[str, int]
    files: dict[str, str]


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    need("mosquitto", "mosquitto_pub")
    folder = tmp_path_factory.mktemp("pki")
    ours, others = Authority(folder, "ours"), Authority(folder, "others")
    clients = {name: by.sign(name) for name, by in (("twin", ours), ("stranger", others))}
    lines, ports = [], {name: free_port() for name in HOSTS}
    for name, (host, days) in HOSTS.items():
        file = ours.sign(name, host, days)
        lines += [f"listener {ports[name]} 127.0.0.1", "require_certificate true",
                  f"certfile {file}", f"keyfile {file.with_suffix('.key')}",
                  f"cafile {ours.file}"]  # fmt: skip
    files = {"ours": ours.file, "others": others.file, **clients}
    with mosquitto(folder, *lines) as broker:
        for port in ports.values():
            listening(port)
        yield Hall(broker, ports, {name: str(file) for name, file in files.items()})


CASES = [
    ("good", "ours", "twin", ""),
    ("good", "others", "twin", "TLS: self-signed certificate in certificate chain"),
    ("elsewhere", "ours", "twin", "TLS: IP address mismatch"),
    ("expired", "ours", "twin", "TLS: certificate has expired"),
    ("good", "ours", "stranger", "TLS: "),
    ("good", "ours", "", "TLS: "),
]


@pytest.mark.parametrize(("port", "ca", "who", "reason"), CASES)
def test_a_source(hall: Hall, port: str, ca: str, who: str, reason: str) -> None:
    file = hall.files.get(who)
    own = {} if file is None else {"certificate": file, "key": file.replace(".pem", ".key")}
    source = robot(hall.ports[port], tls=True, ca=hall.files[ca], client=f"{port}{ca}{who}", **own)
    if reason:
        chunks = listen(source, lambda _: reason in source.health.reason)
        assert not chunks
        return

    def publish() -> None:
        while source.health.state != "up" and not done.is_set():
            hall.broker.publish([said(1)])

    done = threading.Event()
    publishing = threading.Thread(target=publish)
    publishing.start()
    chunks = listen(source, lambda given: bool(given))
    done.set()
    publishing.join()
    assert numbers(chunks)[0] == 1


@pytest.mark.parametrize(("port", "ca", "who", "reason"), CASES[::2])
def test_a_publisher(hall: Hall, port: str, ca: str, who: str, reason: str, tmp_path: Path) -> None:
    both = tmp_path / "both.pem"
    if who:
        both.write_bytes(Path(hall.files[who]).read_bytes()
                         + Path(hall.files[who].replace(".pem", ".key")).read_bytes())  # fmt: skip
    settings = MqttOutSettings(
        "mqtt",
        port=hall.ports[port],
        authority=hall.files[ca],
        certificate=str(both) if who else "",
    )

    async def tell(until: Callable[[Any], bool]) -> dict[str, Any]:
        publisher = MqttOut(settings, About("robot", ()), lambda *_: None)  # type: ignore[arg-type]
        publisher.open()
        try:
            async with asyncio.timeout(15):
                while not until(publisher.health):
                    publisher.publish(News("robot", "rows", {"row": [1]}))
                    await asyncio.sleep(0.01)
            return dict(publisher.health)
        finally:
            await publisher.close()

    if reason:
        told = asyncio.run(tell(lambda health: reason in health["reason"]))
        assert told["state"] == "down" and not told.get("sent")
    else:
        assert asyncio.run(tell(lambda health: health.get("sent", 0) > 0))["state"] == "up"


def test_plain_text_is_not_answered(hall: Hall) -> None:
    source = robot(hall.ports["good"], client="plain", timeout=1.0)

    def refused(given: list[Chunk]) -> bool:
        return source.health.state != "up" and bool(source.health.reason)

    assert not listen(source, refused)
