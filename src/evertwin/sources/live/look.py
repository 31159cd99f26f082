"""A first look at a machine: what it says, before anybody has a map of it.

Modbus: registers side by side in the likely types. MQTT: the topics that are heard, and what their
messages hold. OPC UA: the tree of variables with their node ids, as `nodes` want them. ROS: the
topics of the master by the columns that a twin file names. Nothing is kept at the machine: the
session of a twin is not touched.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Literal

from evertwin.errors import reason_of
from evertwin.sources.foreign import load
from evertwin.sources.live.contract import Around, LiveSettings
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.modbus.source import Block, blocks_of, number_of
from evertwin.sources.live.modbus.spec import Kind, ModbusSettings, Order, Register
from evertwin.sources.live.modbus.wire import Refused, Wire
from evertwin.sources.live.mqtt.connection import LISTEN
from evertwin.sources.live.mqtt.source import Mqtt
from evertwin.sources.live.mqtt.spec import MqttSettings
from evertwin.sources.live.opcua.source import Opcua
from evertwin.sources.live.opcua.spec import OpcuaSettings
from evertwin.sources.live.ros.spec import RosSettings
from evertwin.sources.live.ros.topics import look_ros
from evertwin.sources.spec import SourceSpec

WIDE = 100
"""Registers that are read at once where there is no map."""
FIRST = 1000
"""Registers that are looked at there, and at the places where makers' maps begin."""
SHOWN = 120
"""Of them, lines that are shown at most."""
BASES = (2000, 3000, 4000, 5000, 6000, 8000, 10_000, 20_000, 30_000, 40_000, 50_000)
NODES = 300
DEEP = 6
BROWSED = 60.0
"""Seconds that a tree may take."""
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
    wire, out = Wire(settings.timeout), [_heading()]
    try:
        await wire.connect(settings.host, settings.port)
        if not settings.registers:
            return out + await _surveyed(wire, settings)
        for block in blocks_of(settings.registers.values()):
            try:
                raw = await wire.read(settings.device, *block)
            except Refused as error:
                out.append(f"{block.table:8} {block.address:5} and on: {error}")
                continue
            out += _lines(block, raw, settings)
    finally:
        wire.close()
    return out


async def _surveyed(wire: Wire, settings: ModbusSettings) -> list[str]:
    """What stands where nobody has said anything: registers that hold something, and up to where
    they are answered."""
    out = list[str]()
    tables: tuple[Literal["holding", "input"], ...] = ("holding", "input")
    for table in tables:
        held, answered, why = list[str](), 0, ""
        for address in (*range(0, FIRST, WIDE), *BASES):
            try:
                length, raw = await _reached(wire, settings.device, table, address)
            except Refused as error:
                why = why or f"{table:8} {address:5} and on: {error}"
                continue
            except (LineDown, OSError, TimeoutError) as error:
                if not (answered or out):  # nobody is there
                    raise
                held.append(f"{table:8} {address:5} and on: not asked: {reason_of(error)}")
                await wire.connect(settings.host, settings.port)
                break
            answered += length
            held += _lines(Block(table, address, length), raw, settings, empty=False)
        rest = f"{table:8} {answered} registers answer of the {FIRST + WIDE * len(BASES)} that "
        rest += "were asked (0 to 999, and from round thousands on); those of 0 are not shown"
        more = f"{table:8} … and {len(held) - SHOWN} more: name registers to see them"
        out += [*held[:SHOWN], *[more] * (len(held) > SHOWN), *[rest if answered else why] * (
            bool(answered or why)
        )]  # fmt: skip
    return out


async def _reached(wire: Wire, device: int, table: str, address: int) -> tuple[int, bytes]:
    """As many registers from an address on as are answered: a device refuses all of a block for one
    that it does not have.

    Raises:
        Refused: not even the first is.
    """
    low, high = 1, WIDE
    try:
        return high, await wire.read(device, table, address, high)
    except Refused:
        raw = await wire.read(device, table, address, low)
    while high - low > 1:
        middle = (low + high) // 2
        try:
            low, raw = middle, await wire.read(device, table, address, middle)
        except Refused:
            high = middle
    return low, raw


def _lines(
    block: Block, raw: bytes, settings: ModbusSettings, *, empty: bool = True
) -> Iterator[str]:
    """One register a line; a column of the map with its value, as the twin would take it."""
    mapped: dict[tuple[str, int], tuple[str, Register | None]] = {
        (r.table, r.address): (name, r) for name, r in settings.registers.items()
    }
    bits = block.table in ("coil", "discrete")
    for k in range(block.length):
        if not (empty or any(raw[2 * k : 2 * k + 2])):
            continue
        name, register = mapped.get((block.table, block.address + k), ("", None))
        shown = str(raw[k // 8] >> k % 8 & 1) if bits else _readings(raw[2 * k : 2 * k + 8])
        if register is not None and not bits:
            own = raw[2 * k : 2 * (k + register.words)]
            value = number_of(register, own, settings.word_order, settings.byte_order)
            unit = f" {register.unit}" if register.unit else ""
            name += f" = {f'{value:.6g}{unit}' if math.isfinite(value) else 'none: a sentinel'}"
        yield f"{block.table:8} {block.address + k:5}  {shown}  {name}".rstrip()


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
    async with asyncio.timeout(BROWSED):
        return await _browsed(settings, around)


async def _browsed(settings: OpcuaSettings, around: Around) -> list[str]:
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
            async with asyncio.timeout(settings.timeout):  # it has none of its own
                await client.disconnect()
        client.disconnect_socket()


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
