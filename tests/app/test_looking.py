"""`evertwin doctor site.toml`: what machines say, or that they do not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

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
