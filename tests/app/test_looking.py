"""`evertwin doctor site.toml`: what machines say, or that they do not."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.sources.live.peers import free_port
from tests.sources.live.test_look import floats
from tests.sources.live.test_modbus import server

TWIN = """schema = 1
name = "pump"
[model]
kind = "robot1d"
[[source]]
name = "log"
[source.channels]
v = { column = "v", unit = "m/s" }
x = { column = "x", unit = "m" }
"""
SITE = """schema = 1
name = "hall"
[[twin]]
file = "pump.toml"
[[twin.source]]
source = "log"
protocol = "modbus"
port = PORT
"""


def test_the_machines_of_a_site(tmp_path: Path, call: Callable[..., Any]) -> None:
    (tmp_path / "pump.toml").write_text(TWIN)
    site = tmp_path / "site.toml"
    with server(floats) as port:
        site.write_text(SITE.replace("PORT", str(port)))
        done = call("doctor", str(site))
    assert done.code == 0 and "pump: log (modbus)" in done.out and "42.5" in done.out
    site.write_text(SITE.replace("PORT", str(free_port())))
    done = call("doctor", str(site))
    assert done.code == 1 and "down: Connection refused" in done.out


MAP = """sequence = "n"
[twin.source.registers]
n = { address = 0, type = "uint32" }
t = { address = 2, type = "float64" }
v = { address = 6, type = "float32" }
x = { address = 8, type = "float32" }
"""
WRONG = {
    "": "",
    "word_order": "x reads ",
    "unreadable": "x (holding 50): exception 2: illegal address",
    "misspelt": "lack x",
    "no time": "lack t",
    "bounds": "x: 42.5 in SI, outside of what is possible, -1 to 1",
}


def speaks(asked: bytes) -> bytes:
    """Registers of a map; beyond 10 there are none."""
    address, count = struct.unpack(">HH", asked[8:12])
    if address + count > 10:
        return asked[:4] + struct.pack(">HBBB", 3, asked[6], asked[7] | 0x80, 2)
    number = time.monotonic_ns() // 10**7 & 0xFFFF
    held = struct.pack(">IdffHH", number, 1e9 + number, 0.1, 42.5, 0, 0)
    said = held[2 * address : 2 * (address + count)]
    return asked[:4] + struct.pack(">HBBB", 3 + len(said), asked[6], asked[7], len(said)) + said


@pytest.mark.parametrize("what", WRONG)
def test_a_map_that_does_not_fit_is_named(
    tmp_path: Path, call: Callable[..., Any], what: str
) -> None:
    twin = TWIN.replace('name = "log"\n', 'name = "log"\ntime = { column = "t", unit = "s" }\n')
    twin += "[signals.x]\nlow = -1\nhigh = 1\n" if what == "bounds" else ""
    (tmp_path / "pump.toml").write_text(twin)
    changed = {
        "word_order": MAP.replace("8, type", '8, word_order = "little", type'),
        "unreadable": MAP.replace("address = 8", "address = 50"),
        "misspelt": MAP.replace("\nx = ", "\nxx = "), "no time": MAP.replace("\nt = ", "\ntt = "),
    }.get(what, MAP)  # fmt: skip
    with server(speaks) as port:
        (tmp_path / "site.toml").write_text(SITE.replace("PORT", str(port)) + changed)
        done = call("doctor", str(tmp_path / "site.toml"))
    assert done.code == bool(what), done.out
    assert (WRONG[what] in done.out) and ("WRONG" in done.out) == bool(what)


def test_a_twin_file_with_a_mistake_is_named(tmp_path: Path, call: Callable[..., Any]) -> None:
    (tmp_path / "pump.toml").write_text(TWIN.replace("kind", "kint"))
    with server(floats) as port:
        (tmp_path / "site.toml").write_text(SITE.replace("PORT", str(port)))
        done = call("doctor", str(tmp_path / "site.toml"))
    assert done.code == 1 and "WRONG: " in done.out and "pump.toml:4" in done.out


FLEET = """
[fleet]
store = "postgresql://nobody@127.0.0.1:PORT/hall"
node = "north"
"""
REPLAYED = """
[[twin]]
file = "pump.toml"
name = "NAME"
NODE
[[twin.source]]
source = "log"
protocol = "replay"
files = ["run.csv"]
"""


def test_a_fleet_says_where_each_twin_can_run(tmp_path: Path, call: Callable[..., Any]) -> None:
    (tmp_path / "pump.toml").write_text(TWIN)
    (tmp_path / "run.csv").write_text("t,v,x\n" + "".join(f"{k},1,{k}\n" for k in range(40)))
    pinned, free = (
        REPLAYED.replace("NAME", name).replace("NODE", node)
        for name, node in (("first", 'node = "south"'), ("second", ""))
    )
    site = tmp_path / "site.toml"
    head = SITE.partition("[[twin]]")[0]
    site.write_text(head + pinned + free + FLEET.replace("PORT", str(free_port())))
    done = call("doctor", str(site))
    assert done.code == 1 and "first: pinned to south" in done.out
    assert "second: any node" in done.out and "WRONG: down: 127.0.0.1" in done.out
    assert "WRONG: second: log lies on this machine (replay)" in done.out
    assert "WRONG: first" not in done.out
