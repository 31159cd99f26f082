"""``evertwin init site.toml``: a machine that speaks, read and described."""

from __future__ import annotations

import json
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import paho.mqtt.client as paho
import pytest

from evertwin.app.cli import main
from evertwin.config import read
from evertwin.service.site.site_plan import read_site
from tests.sources.live.test_modbus import server
from tests.sources.live.test_mqtt import mosquitto
from tests.sources.live.test_opcua import Server

BEGAN = time.monotonic()
SITE = """schema = 1
name = "hall"
[[twin]]
file = "cart.toml"
[[twin.source]]
source = "plc"
protocol = "modbus"
port = {port}
period = "20 ms"
"""
MAP = """[twin.source.registers]
v_cmd = {{ address = 0, type = "int16", scale = 0.1, unit = "cm/s" }}
x = {{ address = 1, type = "float32", word_order = "little", unit = "m" }}
{time}
"""


def cart(asked: bytes) -> bytes:
    """A cart told to drive to and fro, 10 % too fast: command [mm/s], place with its words swapped,
    clock [ms]."""
    t = time.monotonic() - BEGAN
    speed, way = (100, t % 2.0) if t % 4.0 < 2.0 else (-100, 2.0 - t % 2.0)
    first, count = struct.unpack(">HH", asked[8:12])
    place = struct.pack(">f", 0.11 * way)
    clock = struct.pack(">I", round(1e3 * t))
    memory = (struct.pack(">h", speed) + place[2:] + place[:2] + clock).ljust(200, b"\0")
    content = memory[2 * first : 2 * (first + count)]
    head = struct.pack(">HBBB", 3 + len(content), asked[6], asked[7], len(content))
    return asked[:4] + head + content


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[object, str, str]:
    with pytest.raises(SystemExit) as done:
        main(words)
    told = capsys.readouterr()
    return done.value.code, told.out, told.err


@pytest.mark.parametrize("clock", [True, False], ids=["its clock", "no clock"])
def test_a_machine_is_read_and_described(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], *, clock: bool
) -> None:
    site = tmp_path / "site.toml"
    own = 't = { address = 3, type = "uint32" }' if clock else ""
    with server(cart) as port:
        site.write_text(SITE.format(port=port))
        code, _, bare = said(["init", str(site)], capsys)
        assert code == 2 and "nothing is mapped: name its columns" in bare
        site.write_text(SITE.format(port=port) + MAP.format(time=own))
        words = ["init", str(site), "--model", "robot1d", "--seconds", "6"]
        code, out, err = said(words, capsys)
    assert code in (0, None), err
    assert "2 channels found" in out and f"evertwin serve {site}" in err
    assert ('say stamp = "arrival"' in err) is not clock
    (source,) = read(tmp_path / "cart.toml").source
    assert source.name == "plc" and source.channels["v"].unit == "cm/s"
    assert (source.time.column, source.time.unit) == (("t", "ms") if clock else ("t", "s"))
    assert source.files == ("cart_plc.csv",) and (tmp_path / "cart_plc.csv").exists()
    (plan,) = read_site(site).twins
    assert plan.wrong == "", "the site file takes it as it is"
    assert "there already: cart.toml" in said(["init", str(site)], capsys)[2]


@contextmanager
def again_and_again(say: Callable[[int], object]) -> Iterator[None]:
    """Somebody speaks, a hundred times a second."""
    over = threading.Event()

    def speak() -> None:
        k = 0
        while not over.wait(0.01):
            say(k)
            k += 1

    speaking = threading.Thread(target=speak)
    speaking.start()
    try:
        yield
    finally:
        over.set()
        speaking.join()


def head(protocol: str, *sources: str) -> str:
    told = "".join(f'[[twin.source]]\nprotocol = "{protocol}"\n{one}\n' for one in sources)
    return f'schema = 1\nname = "hall"\n[[twin]]\nfile = "cart.toml"\n{told}'


@pytest.mark.system
def test_dates_of_messages_are_the_stamps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two topics of a machine in time-lapse: half a second of its clock in 10 ms of ours."""
    site, names = tmp_path / "site.toml", (("order", "v"), ("place", "x"))
    start = datetime(2025, 3, 30, 0, 59, tzinfo=UTC)

    def message(k: int, name: str) -> bytes:
        value = (1.0 if k % 40 < 20 else -1.0) if name == "v" else 0.5 * abs((k + 20) % 40 - 20)
        date = (start + timedelta(seconds=0.5 * k)).isoformat()
        return json.dumps({"at": date, "state": "RUN", name: value}).encode()

    with mosquitto(tmp_path) as broker:
        site.write_text(head("mqtt", *(
            f'source = "{topic}"\nport = {broker.port}\ntopic = "cell/{topic}"\n'
            f'[twin.source.columns]\nat = "at"\nstate = "state"\n{name} = "{name}"'
            for topic, name in names
        )))  # fmt: skip
        publisher = paho.Client(paho.CallbackAPIVersion.VERSION2)
        publisher.connect("127.0.0.1", broker.port)
        publisher.loop_start()

        def say(k: int) -> None:
            for topic, name in names:
                publisher.publish(f"cell/{topic}", message(k, name), qos=1)

        with again_and_again(say):
            code, _, err = said(["init", str(site), "--model", "robot1d", "--seconds", "3"], capsys)
        publisher.disconnect()
        publisher.loop_stop()
    assert code in (0, None), err
    assert 'say stamp = "arrival"' not in err
    for source in read(tmp_path / "cart.toml").source:
        assert (source.time.column, source.time.unit) == ("at", "iso")
    text = (tmp_path / "cart_order.csv").read_text().splitlines()
    assert text[0] == "at,v" and len(text) > 50
    dates = np.array([line.split(",")[0].rstrip("Z") for line in text[1:]], "datetime64[ns]")
    assert set(np.diff(dates).astype(int).tolist()) == {500_000_000}


def test_stamps_of_the_protocol_are_the_machine_s(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """10 ms of its clock, of 2020, in about as long."""
    site, peer = tmp_path / "site.toml", Server(tmp_path)
    site.write_text(head(
        "opcua", f'source = "arm"\nurl = "opc.tcp://127.0.0.1:{peer.port}/arm"\nperiod = "20 ms"\n'
        'namespace = "urn:arm"\n[twin.source.nodes]\nn = "s=n"\nx = "s=x"',
    ))  # fmt: skip
    try:
        with again_and_again(lambda k: peer.say(k, k * k % 17, "good")):
            words = ["init", str(site), "--seconds", "3", "--model", "python", "--answer"]
            code, _, err = said([*words, "u.column=n", "y.column=x"], capsys)
    finally:
        peer.process.kill()
        peer.process.communicate()
    assert code in (0, None), err
    table = np.loadtxt(tmp_path / "cart_arm.csv", delimiter=",", skiprows=1)
    began = datetime(2020, 1, 1, tzinfo=UTC).timestamp()
    assert len(table) > 30
    assert table[:, 0] == pytest.approx(began + 0.01 * table[:, 1], abs=1e-5)


def test_a_recording_that_grows_is_read_as_it_stands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = (f"{0.1 * k:.1f},{k // 20 % 2},{0.1 * (k % 40):.2f}" for k in range(200))
    (tmp_path / "log.csv").write_text("t [s],v_cmd [m/s],x [m]\n" + "\n".join(rows))
    site = tmp_path / "site.toml"
    told = 'source = "plc"\nprotocol = "file"\npath = "log.csv"\n'
    site.write_text(
        f'schema = 1\nname = "hall"\n[[twin]]\nfile = "cart.toml"\n[[twin.source]]\n{told}'
    )
    assert said(["init", str(site), "--model", "robot1d"], capsys)[0] in (0, None)
    (source,) = read(tmp_path / "cart.toml").source
    assert (source.name, source.files) == ("plc", ("log.csv",))


def test_several_answers_are_one_list(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = "\n".join(f"{k % 7},{k}" for k in range(50))
    (tmp_path / "run.csv").write_text(f"pump,place\n{rows}")
    out = tmp_path / "new.toml"
    answers = ["--answer", "log.rate=10 Hz", "u.column=place", "y.column=pump"]
    words = ["init", str(tmp_path / "run.csv"), "-o", str(out), "--model", "python", *answers]
    assert said(words, capsys)[0] in (0, None)
    assert read(out).source[0].channels["u"].column == "place"
