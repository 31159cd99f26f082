"""A machine that nobody has described yet: sampled, and a first twin of it."""

from __future__ import annotations

import asyncio
import json
import struct
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi import HTTPException
from pydantic import ValidationError

from evertwin.config import read
from evertwin.errors import UsageError
from evertwin.service.http.api_views import Look, _look
from evertwin.service.site.site_spec import SITE
from evertwin.service.views.new_machine import (
    Column,
    Machine,
    _sampled,
    _site,
    added,
    first_twin,
    kinds,
    roles,
)
from evertwin.setup.configured_model import model_of
from evertwin.sources.live.registry import open_live, read_settings
from evertwin.sources.live.trying import some
from planted.draws import first_of
from tests.sources.live.test_modbus import server
from tests.sources.live.test_mqtt import Broker, mosquitto

BEGAN = time.monotonic()


def cart(asked: bytes) -> bytes:
    """A cart that drives 20 % faster than it is told: command [cm/s] and place [cm] as floats."""
    t = time.monotonic() - BEGAN
    first, count = struct.unpack(">HH", asked[8:12])
    memory = struct.pack(">ff", 20.0, 20.0 * 1.2 * t).ljust(200, b"\0")
    content = memory[2 * first : 2 * (first + count)]
    return (
        asked[:4]
        + struct.pack(">HBBB", 3 + len(content), asked[6], asked[7], len(content))
        + content
    )


def machine(port: int, **changes: Any) -> Machine:
    columns = [Column(place="0:float32", name="v", unit="cm/s"),
               Column(place="2:float32", name="x", unit="cm")]  # fmt: skip
    told: dict[str, Any] = {
        "protocol": "modbus", "port": port, "kind": "robot1d", "columns": columns, "seconds": 2.0,
        "name": "cart", **changes,
    }  # fmt: skip
    return Machine(**told)


def test_registers_become_a_twin_that_says_how_far_it_is_off(tmp_path: Path) -> None:
    with server(cart) as port:
        asked = machine(port)
        found = asyncio.run(added(asked))
    assert found["rows"] >= 10 and found["newest"]["v"] == pytest.approx(20.0)
    assert found["questions"] == []
    ((output, off),) = [(one["output"], one["rms"]) for one in found["residual"]]
    assert output == "x" and 0.002 < off < 0.5, "20 % of 20 cm/s, from prediction to prediction"
    (tmp_path / "cart.toml").write_text(found["twin"])
    spec = read(tmp_path / "cart.toml")
    assert model_of(spec, None).outputs.names == ("x",)
    assert spec.source[0].channels["x"].unit == "cm" and spec.source[0].name == "log"
    (entry,) = SITE.parse('schema = 1\nname = "hall"\n' + found["site"]).twin
    assert read_settings(asked.table).registers["x"].address == 2  # type: ignore[attr-defined]
    assert entry.file.endswith("cart.toml")


def test_words_that_are_swapped_a_factor_and_a_number_that_means_nothing() -> None:
    def odd(asked: bytes) -> bytes:
        """20 cm/s in tenths, now and then without a value; a place with its words swapped."""
        t = time.monotonic() - BEGAN
        first, count = struct.unpack(">HH", asked[8:12])
        there = struct.pack(">f", 24.0 * t)
        speed = 200 if int(3 * t) % 2 else -32768
        memory = struct.pack(">h", speed) + there[2:] + there[:2]
        content = memory.ljust(200, b"\0")[2 * first : 2 * (first + count)]
        head = struct.pack(">HBBB", 3 + len(content), asked[6], asked[7], len(content))
        return asked[:4] + head + content

    columns = [Column(place="0:int16 *0.1 !-32768", name="v", unit="cm/s"),
               Column(place="1:float32 swapped", name="x", unit="cm")]  # fmt: skip
    with server(odd) as port:
        asked = machine(port, columns=columns)
        t, v = asyncio.run(_sampled(asked))
    speeds = v[:, 0][np.isfinite(v[:, 0])]
    assert 2 <= len(speeds) < len(v) and set(speeds.round(9)) == {20.0}
    assert np.polyfit(t, v[:, 1], 1)[0] == pytest.approx(24.0, rel=0.1)
    assert 'word_order = "little"' in _site(asked) and "sentinels = [-32768" in _site(asked)
    unknown = machine(1, columns=[Column(place="q", name="x", unit="m")])
    with pytest.raises(UsageError, match="expected as in 8, 8:float32 swapped"):
        assert unknown.table


def test_a_unit_behind_a_modbus_address_is_asked_by_its_number() -> None:
    def third(asked: bytes) -> bytes:
        return cart(asked) if asked[6] == 3 else asked[:4] + b"\0\3" + bytes([asked[6], 131, 11])

    with server(third) as port:
        found = asyncio.run(added(machine(port, device=3)))
        lines = asyncio.run(_look(Look(protocol="modbus", port=port, device=3)))
        with pytest.raises(HTTPException) as told:
            asyncio.run(added(machine(port, seconds=0.5)))
    assert found["rows"] >= 10 and "device = 3" in found["site"] and len(lines) > 3
    assert "exception 11" in told.value.detail


@pytest.mark.system
@first_of(("unit", "factor"), [("ms", 1e3), ("s", 1), ("ns", 1e9)])
def test_what_is_proposed_reads_the_machine_it_was_proposed_for(
    tmp_path: Path, unit: str, factor: float
) -> None:
    ended = threading.Event()

    def publish(broker: Broker) -> None:
        while not ended.is_set():
            t = time.time()
            said = {"ts": t * factor if unit == "s" else int(t * factor), "v": 0.2, "x": 0.24 * t}
            broker.publish([json.dumps(said).encode()], "cart/state")
            time.sleep(0.05)

    columns = [Column(place="ts", name="t", unit=unit), Column(place="v", name="v", unit="m/s"),
               Column(place="x", name="x", unit="m")]  # fmt: skip
    with mosquitto(tmp_path) as broker:
        publishing = threading.Thread(target=publish, args=(broker,))
        publishing.start()
        try:
            asked = machine(broker.port, protocol="mqtt", topic="cart/state", columns=columns)
            found = asyncio.run(added(asked))
            (tmp_path / "cart.toml").write_text(found["twin"])
            spec = read(tmp_path / "cart.toml").source[0]
            source = open_live(read_settings(asked.table), spec)
            source.open()
            chunks = asyncio.run(some(source, 5, 5.0))
        finally:
            ended.set()
            publishing.join()
    assert spec.time.unit == unit and len(chunks) >= 5
    assert abs(chunks[0].t[0] * 1e-9 - time.time()) < 60


def test_what_is_not_said_yet_is_asked() -> None:
    t = 0.1 * np.arange(50)
    found = first_twin("cart", "robot1d", [("v", "m/s")], t, np.full((50, 1), 0.2))
    assert any("x" in one for one in found["questions"]) and found["residual"] == []


def test_every_kind_tells_its_roles() -> None:
    assert {"arm", "drive", "robot1d"} <= set(kinds())
    assert not {"python", "fmu", "mujoco", "modelica", "table"} & set(kinds()), "they need files"
    assert {"name": "tau1", "unit": "Nm", "side": "output"} in roles("arm")


def test_a_machine_that_is_not_there_is_said_so() -> None:
    with pytest.raises(HTTPException) as told:
        asyncio.run(added(machine(9, seconds=0.5)))
    assert told.value.status_code == 502


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "python"}, {"seconds": 1e9}, {"name": "../../etc/passwd"}, {"protocol": "file"},
        {"columns": []}, {"columns": [{"place": "0\nfile = 'x'", "name": "v", "unit": "m"}]},
        {"columns": [{"place": "0", "name": 'v = 1"', "unit": "m"}]},
    ],
)  # fmt: skip
def test_nothing_but_a_machine_can_be_asked_for(changes: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        machine(502, **changes)


@pytest.mark.parametrize(
    "column",
    [("eight", "v", "m/s"), ("8", "v", "bogus"), ("8:float99", "v", "m/s"), ("8", "t", "m")],
)
def test_what_cannot_be_read_so_is_refused(column: tuple[str, str, str]) -> None:
    named = dict(zip(("place", "name", "unit"), column, strict=True))
    both = [named, {"place": "2", "name": "x", "unit": "m"}]
    with pytest.raises(UsageError):
        asyncio.run(added(machine(502, columns=both)))
