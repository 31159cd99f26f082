"""A first look at a machine: what it says, before anybody has a map of it.

Modbus: registers side by side in the likely types. MQTT: the topics that are heard, and what their
messages hold. OPC UA: the tree of variables with their node ids, as `nodes` want them. ROS: the
topics of the master by the columns that a twin file names. Nothing is kept at the machine: the
session of a twin is not touched.
"""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

from evertwin.sources.foreign import load
from evertwin.sources.live.contract import Around, LiveSettings
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.look_ros import look_ros
from evertwin.sources.live.modbus import Block, blocks_of, number_of
from evertwin.sources.live.modbus_spec import Kind, ModbusSettings, Order, Register
from evertwin.sources.live.modbus_wire import Refused, Wire
from evertwin.sources.live.mqtt import Mqtt
from evertwin.sources.live.mqtt_line import LISTEN
from evertwin.sources.live.mqtt_spec import MqttSettings
from evertwin.sources.live.opcua import Opcua
from evertwin.sources.live.opcua_spec import OpcuaSettings
from evertwin.sources.live.ros_spec import RosSettings
from evertwin.sources.spec import SourceSpec

WIDE = 40
"""Registers that are looked at where there is no map."""
NODES = 300
DEEP = 6
_LIKELY: tuple[tuple[Kind, Order], ...] = (
    ("int16", "big"), ("int32", "big"), ("int32", "little"), ("float32", "big"),
    ("float32", "little"), ("float64", "big"),
)  # fmt: skip


async def look(settings: LiveSettings, around: Around) -> list[str]:
    """What there is to see, in lines.

    Raises:
        LineDown, OSError, TimeoutError: nobody is there.
    """
    if isinstance(settings, ModbusSettings):
        return await _registers(settings)
    if isinstance(settings, MqttSettings):
        return await _topics(settings, around)
    if isinstance(settings, OpcuaSettings):
        return await _tree(settings, around)
    if isinstance(settings, RosSettings):
        return await look_ros(settings.place, {})
    return [f"protocol {settings.protocol!r}: its files are looked at with 'evertwin info'"]


async def _registers(settings: ModbusSettings) -> list[str]:
    blocks = blocks_of(settings.registers.values()) if settings.registers else []
    blocks = blocks or [Block("holding", 0, WIDE), Block("input", 0, WIDE)]
    mapped = {f"{r.table} {r.address}": name for name, r in settings.registers.items()}
    wire, out = Wire(settings.timeout), [_heading()]
    try:
        await wire.connect(settings.host, settings.port)
        for block in blocks:
            try:
                raw = await wire.read(settings.device, *block)
            except Refused as error:
                out.append(f"{block.table:8} {block.address:5} and on: {error}")
                continue
            bits = block.table in ("coil", "discrete")
            for k in range(block.length):
                name = mapped.get(f"{block.table} {block.address + k}", "")
                shown = str(raw[k // 8] >> k % 8 & 1) if bits else _readings(raw[2 * k : 2 * k + 8])
                out.append(f"{block.table:8} {block.address + k:5}  {shown}  {name}".rstrip())
    finally:
        wire.close()
    return out


def _heading() -> str:
    names = (f"{kind}{' words swapped' * (order == 'little')}" for kind, order in _LIKELY)
    return "register         bits" + "".join(f"  {name:>21}" for name in names)


def _readings(raw: bytes) -> str:
    """The same registers in each of the likely types."""
    out = [raw[:2].hex()]
    for kind, order in _LIKELY:
        register = Register(0, kind)
        part = raw[: 2 * register.words]
        whole = len(part) == 2 * register.words
        out.append(f"{number_of(register, part, order, 'big'):>21.9g}" if whole else " " * 21)
    return "  ".join(out)


async def _topics(settings: MqttSettings, around: Around) -> list[str]:
    found = await Mqtt(settings, SourceSpec("look", {}), around).heard(LISTEN)
    most = "as many messages as its settings say (MQTT 3.1.1 does not tell)"
    if found.inflight is not None:
        most = f"{found.inflight} messages at most"
    out = [
        f"the broker sends {most} that are not acknowledged; ask in its own settings whether it "
        "keeps sessions (persistence, autosave) and how many messages wait (max_queued_messages)"
    ]
    for topic, count in sorted(found.topics.items()):
        out.append(f"{topic}  {count / LISTEN:.1f} a second  {_content(found.newest[topic])}")
    return out if found.topics else [*out, f"no message within {LISTEN:.0f} s"]


def _content(payload: bytes) -> str:
    try:
        tree = json.loads(payload)
    except (ValueError, RecursionError):
        return f"{len(payload)} bytes that are not JSON"
    return "  ".join(f"{path or 'value'}={value!r}" for path, value in _leaves(tree, "")[:12])


def _leaves(tree: Any, path: str) -> list[tuple[str, Any]]:
    """The numbers and texts of a message, with their paths."""
    inner: list[tuple[Any, Any]]
    if isinstance(tree, dict):
        inner = list(tree.items())
    elif isinstance(tree, list):
        inner = list(enumerate(tree))
    else:
        return [(path, tree)]
    below = ((f"{path}.{key}".strip("."), part) for key, part in inner[:12])
    return [leaf for place, part in below for leaf in _leaves(part, place)]


async def _tree(settings: OpcuaSettings, around: Around) -> list[str]:
    asyncua = load("asyncua", "live")
    source = Opcua(settings, SourceSpec("look", {}), around)
    client = asyncua.Client(settings.url, timeout=settings.timeout)
    try:
        await source.connect(client)
        spaces = await client.get_namespace_array()
        out: list[str] = []
        await _branch(client.nodes.objects, spaces, 0, out)
        return out[:NODES]
    except asyncua.ua.UaError as error:
        raise LineDown(str(error)) from None
    finally:
        with suppress(OSError, TimeoutError, asyncua.ua.UaError):
            await client.disconnect()


async def _branch(node: Any, spaces: list[str], depth: int, out: list[str]) -> None:
    ua = load("asyncua.ua", "live")
    for child in await node.get_children():
        if len(out) >= NODES or (child.nodeid.NamespaceIndex == 0 and depth == 0):
            continue
        name = (await child.read_browse_name()).Name
        rest = child.nodeid.to_string().rpartition(";")[2]
        shown = f"{'  ' * depth}{name}  nsu={spaces[child.nodeid.NamespaceIndex]};{rest}"
        if await child.read_node_class() == ua.NodeClass.Variable:
            said = await child.read_data_value(raise_on_bad_status=False)
            value = None if said.Value is None else said.Value.Value
            shown += f"  {value!r:.40}  {said.StatusCode.name}"
        out.append(shown)
        if depth < DEEP:
            await _branch(child, spaces, depth + 1, out)
