"""A first look at machines, as `evertwin doctor site.toml` prints it."""

from __future__ import annotations

import asyncio
import struct
import threading
import time
from pathlib import Path

import pytest

from evertwin.app.cli import main
from evertwin.sources.live.contract import Around
from evertwin.sources.live.look import look
from evertwin.sources.live.registry import read_settings
from tests.sources.live.peers import free_port
from tests.sources.live.test_modbus import server
from tests.sources.live.test_mqtt import mosquitto, said


def floats(asked: bytes) -> bytes:
    """42.5 in every pair of registers; input registers are refused."""
    count = struct.unpack(">H", asked[10:12])[0]
    if asked[7] == 4:
        return asked[:4] + struct.pack(">HBBB", 3, asked[6], 0x84, 2)
    content = (struct.pack(">f", 42.5) * count)[: 2 * count]
    return asked[:4] + struct.pack(">HBBB", 3 + len(content), asked[6], 3, len(content)) + content


def doctor(site: Path) -> object:
    with pytest.raises(SystemExit) as ended:
        main(["doctor", str(site)])
    return ended.value.code


def test_registers_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "pump.toml").write_text(
        'schema = 1\nname = "pump"\n[model]\nkind = "robot1d"\n[[source]]\nname = "log"\n'
        '[source.channels]\nv = { column = "v", unit = "m/s" }\nx = { column = "x", unit = "m" }\n'
    )
    site = tmp_path / "site.toml"
    with server(floats) as port:
        text = 'schema = 1\nname = "hall"\n[[twin]]\nfile = "pump.toml"\n[[twin.source]]\n'
        text += f'source = "log"\nprotocol = "modbus"\nport = {port}\n'
        site.write_text(text)
        assert doctor(site) == 0
        out = capsys.readouterr().out
        assert "pump: log (modbus)" in out and "input        0 and on: exception 2" in out
        row = next(line for line in out.splitlines() if line.startswith("  holding      0"))
        assert row.split()[2] == "422a" and "42.5" in row
        site.write_text(
            text + "[twin.source.registers]\nspeed = { address = 0, type = 'float32' }\n"
        )
        assert doctor(site) == 0
        assert "speed" in capsys.readouterr().out
    site.write_text(text.replace(str(port), str(free_port())))
    assert doctor(site) == 1
    assert "down: Connection refused" in capsys.readouterr().out


@pytest.mark.system
def test_topics_of_a_broker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evertwin.sources.live.look.LISTEN", 1.0)
    with mosquitto(tmp_path) as broker:
        table = {"source": "robot", "protocol": "mqtt", "port": broker.port}

        def publish() -> None:
            time.sleep(0.3)
            broker.publish([said(1)])

        publishing = threading.Thread(target=publish)
        publishing.start()
        lines = asyncio.run(look(read_settings(table), Around(tmp_path)))
        publishing.join()
    assert "20 messages at most" in lines[0] and lines[1].startswith("robot/state  1.0 a second")
    assert "pose.x=1" in lines[1] and "q.0=1" in lines[1]
