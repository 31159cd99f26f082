"""The OPC UA publisher's policies against a client on asyncua: who is trusted reads."""

from __future__ import annotations

import asyncio
import gc
import logging
import math
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from evertwin.errors import UsageError
from evertwin.publishers.contract import About, News
from evertwin.publishers.opcua import OpcuaOut
from evertwin.publishers.opcua_spec import OpcuaOutSettings
from tests.sources.live.peers import free_port
from tests.sources.live.pki import own

FAULTS = (ua.UaError, ConnectionError, TimeoutError, asyncio.TimeoutError)


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    yield
    logging.getLogger("asyncua").setLevel(logging.NOTSET)


@asynccontextmanager
async def told(folder: Path) -> AsyncIterator[int]:
    """A server that trusts what lies in ``trust``."""
    certificate, key = own(folder, "twin")
    port = free_port()
    settings = OpcuaOutSettings(
        "opcua", "127.0.0.1", port, "Basic256Sha256", certificate.name, key.name, "trust"
    ).at(folder)
    publisher = OpcuaOut(settings, About("robot", (("x", "m"),)), lambda *_: None)  # type: ignore[arg-type]
    publisher.open()
    try:
        async with asyncio.timeout(30):
            while publisher.health["state"] != "up":
                assert publisher.health["state"] == "connecting", publisher.health
                await asyncio.sleep(0.02)
        yield port
    finally:
        await publisher.close()


LIFE = {
    "components": {
        "gearbox": {
            "indicator": "wear", "unit": "Nm", "value": 4.0, "limit": 6.0, "sentence": "60 h left",
            "life": {"median": 60.0, "interval80": [40.0, None], "unit": "h"},
        },
        "belt": {
            "indicator": "tension", "unit": "N", "value": None, "limit": 2.0, "sentence": "unknown",
            "life": {"verdict": "not enough data", "needs": "3 values"},
        },
    },
    "alarms": [{"component": "gearbox", "kind": "failure_due"}],
}  # fmt: skip


def test_lives_are_variables_and_nothing_waits_while_a_server_loads() -> None:
    port, full = free_port(), []
    publisher = OpcuaOut(
        OpcuaOutSettings("opcua", "127.0.0.1", port),
        About("robot", (("x", "m"),)),
        lambda *_: None,  # type: ignore[arg-type]
    )

    def collected(when: str, about: dict[str, int]) -> None:
        full.append(about["generation"])

    async def read_lives() -> dict[str, Any]:
        publisher.open()
        async with asyncio.timeout(30):
            while publisher.health["state"] != "up":
                await asyncio.sleep(0.02)
        found = list(full)
        publisher.publish(News("robot", "life", LIFE))
        while not publisher.health.get("sent"):
            await asyncio.sleep(0.02)
        async with Client(f"opc.tcp://127.0.0.1:{port}/evertwin") as client:
            space = await client.get_namespace_index("urn:evertwin:twin")
            told: dict[str, Any] = {"collected": found}
            for name in ("gearbox.low", "gearbox.median", "gearbox.high", "gearbox.unit",
                         "belt.median"):  # fmt: skip
                node = client.get_node(ua.NodeId(f"robot.life.{name}", space))
                value = await node.read_data_value(raise_on_bad_status=False)
                told[name] = value.Value.Value if value.StatusCode.is_good() else None
        await publisher.close()
        return told

    gc.callbacks.append(collected)
    try:
        told = asyncio.run(read_lives())
    finally:
        gc.callbacks.remove(collected)
    assert 2 not in told.pop("collected") and gc.isenabled()
    assert told == {
        "gearbox.low": 40.0, "gearbox.median": 60.0, "gearbox.high": math.inf, "gearbox.unit": "h",
        "belt.median": None,
    }  # fmt: skip


async def read(port: int, who: tuple[Path, Path] | None, server: Path) -> Any:
    """What a client reads, or the name of what it is refused with."""
    client = Client(f"opc.tcp://127.0.0.1:{port}/evertwin", timeout=5)
    try:
        if who is not None:
            client.application_uri = f"urn:{who[0].stem}"
            await client.set_security(
                SecurityPolicyBasic256Sha256, str(who[0]), str(who[1]),
                server_certificate=str(server),
            )  # fmt: skip
        async with client:
            space = await client.get_namespace_index("urn:evertwin:twin")
            node = client.get_node(ua.NodeId("robot.condition", space))
            with pytest.raises(ua.UaStatusCodeError):
                await node.write_value("good")
            return await node.read_value()
    except FAULTS as error:
        return type(error).__name__
    finally:
        client.disconnect_socket()


def test_only_certificates_of_the_trust_folder_open_a_session(tmp_path: Path) -> None:
    trust = tmp_path / "trust"
    trust.mkdir()
    panel, stranger = own(tmp_path, "panel"), own(tmp_path, "stranger")
    old = own(tmp_path, "old", (-9, -2))
    for file in (panel[0], old[0]):
        (trust / file.name).write_bytes(file.read_bytes())

    async def all_of_them() -> None:
        async with told(tmp_path) as port:
            server = tmp_path / "twin.der"
            assert await read(port, panel, server) == "check"
            for who in (stranger, old, None):
                assert (await read(port, who, server)).startswith(("Bad", "UaError")), who
            assert await taken_over(port, panel, server)
            (trust / panel[0].name).unlink()  # taken away: at the next session it is a stranger
            assert await read(port, panel, server) == "BadUserAccessDenied"
            (trust / "stranger.der").write_bytes(stranger[0].read_bytes())
            assert await read(port, stranger, server) == "check"

    asyncio.run(all_of_them())


async def taken_over(port: int, who: tuple[Path, Path], server: Path) -> bool:
    """Is a session refused to who names its number, on a line without security?"""
    theirs = Client(f"opc.tcp://127.0.0.1:{port}/evertwin", timeout=5)
    theirs.application_uri = f"urn:{who[0].stem}"
    await theirs.set_security(
        SecurityPolicyBasic256Sha256, str(who[0]), str(who[1]), server_certificate=str(server)
    )
    async with theirs:
        token = theirs.uaclient.protocol.authentication_token  # type: ignore[union-attr]
        other = Client(f"opc.tcp://127.0.0.1:{port}/evertwin", timeout=5)
        await other.connect_socket()
        try:
            await other.send_hello()
            await other.open_secure_channel()
            other.uaclient.protocol.authentication_token = token  # type: ignore[union-attr]
            asked = ua.ActivateSessionParameters()
            asked.UserIdentityToken = ua.AnonymousIdentityToken(PolicyId="anonymous")
            with pytest.raises(ua.UaError):
                await other.uaclient.activate_session(asked)
            with pytest.raises((ua.UaError, ConnectionError)):
                await other.nodes.server_state.read_value()
        finally:
            other.disconnect_socket()
    return True


@pytest.mark.parametrize(
    ("settings", "said"),
    [({"host": "0.0.0.0"}, "expected security"), ({"host": "hall"}, "expected security"),
     ({"security": "Basic256Sha256"}, "needs certificate, key, trust")],
)  # fmt: skip
def test_beyond_this_machine_only_with_security(settings: dict[str, str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        OpcuaOutSettings("opcua", **settings)  # type: ignore[arg-type]


def test_a_file_that_is_no_certificate_is_told(tmp_path: Path) -> None:
    for name in ("own.der", "own.pem"):
        (tmp_path / name).write_bytes(b"nothing")
    settings = OpcuaOutSettings(
        "opcua", "127.0.0.1", free_port(), "Basic256Sha256", "own.der", "own.pem", "trust"
    ).at(tmp_path)

    async def down() -> str:
        publisher = OpcuaOut(settings, About("robot", ()), lambda *_: None)  # type: ignore[arg-type]
        publisher.open()
        while publisher.health["state"] == "connecting":
            await asyncio.sleep(0.02)
        state = str(publisher.health["state"])
        await publisher.close()
        return state

    assert asyncio.run(down()) == "down"
