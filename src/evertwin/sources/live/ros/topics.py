"""A first look at a ROS 1 master: its topics, their rates, and what becomes of their fields.

>>> from evertwin.sources.spec import ChannelSpec
>>> spec = SourceSpec("odom", {"x": ChannelSpec("/odom.pose.pose.position.x", "m")})
>>> wanted(RosSettings("odom", "ros", topic="/robot1/odom"), spec)
{'/robot1/odom': {'pose.pose.position.x': 'x [m]'}}
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from typing import TypeAlias

from evertwin.errors import DataError
from evertwin.ros.node import Raw, Subscription, node_at
from evertwin.ros.spec import Place
from evertwin.ros.topics import topics_of
from evertwin.sources.live.ros.spec import RosSettings
from evertwin.sources.robot_logs.bag_files import Connection as Topic
from evertwin.sources.robot_logs.bag_files import Message
from evertwin.sources.robot_logs.ros_messages import Decoder, array_of, flat, stamp_of
from evertwin.sources.spec import ArraySpec, SourceSpec

Wanted: TypeAlias = Mapping[str, Mapping[str, str]]
"""Topic → field → channel that it becomes."""
LISTEN = 3.0
"""Seconds in which topics are heard."""
CELLS = 12
"""Fields of a topic that are shown beside those that become channels."""
HEAVY = ("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/PointCloud2")
"""Types that are named and not listened to."""


def wanted(settings: RosSettings, spec: SourceSpec | ArraySpec) -> dict[str, dict[str, str]]:
    """What a twin file takes from the topic of one of its sources."""
    found: dict[str, dict[str, str]] = {}
    if isinstance(spec, ArraySpec):
        columns = {str(spec.column): f"array {spec.name}"}
    else:
        columns = {str(one.column): f"{name} [{one.unit}]" for name, one in spec.channels.items()}
    for column, channel in columns.items():
        prefix, _, field = column.partition(".")
        found.setdefault(settings.topic or prefix, {})[field] = channel
    return found


async def look_ros(place: Place, known: Wanted) -> list[str]:
    """The topics of a master, a line each; then what the twin file wants and nobody says.

    Raises:
        NodeDown, OSError, TimeoutError: nobody is there.
    """
    async with node_at(place) as node:
        said = await topics_of(place)
        light = [topic for topic, kind in said.items() if kind not in HEAVY]
        lines = [node.subscribe(topic) for topic in light]
        await asyncio.sleep(LISTEN)
        found = dict(zip(light, await asyncio.gather(*map(_heard, lines)), strict=True))
    out, lacking = [], {topic: dict(fields) for topic, fields in known.items()}
    for topic, kind in said.items():
        count, raw = found.get(topic, (-1, None))
        told = "not listened to" if count < 0 else "silent"
        if raw is not None:
            told = _told(raw, count, lacking.get(topic, {}))
        out.append(f"{topic}  {kind}  {told}")
    for topic, fields in lacking.items():
        for field, channel in fields.items():
            out.append(f"nobody says {topic}.{field}, of which the twin file makes {channel}")
    return out or ["no topic: nobody publishes at this master"]


async def _heard(line: Subscription) -> tuple[int, Raw | None]:
    """How many messages wait, and the newest."""
    count, raw = 0, None
    with suppress(TimeoutError):
        while True:
            async with asyncio.timeout(0.01):
                raw = await line.next()
            count += 1
    return count, raw


def _told(raw: Raw, count: int, channels: dict[str, str]) -> str:
    """Rate and fields of a topic; takes from ``channels`` what was found."""
    rate = f"{count / LISTEN:.1f} a second"
    connection = Topic(raw.topic, raw.type, "ros1", raw.definition)
    try:
        content = Decoder().content(Message(connection, raw.at, raw.data))
    except DataError as error:
        return f"{rate}  {error}"
    clock = "logged" if stamp_of(content) is None else "stamp"
    cells = dict(flat(content))
    mapped = [
        f"{raw.topic}.{name}={cells[name]:.6g} → {channels.pop(name)}"
        for name in list(channels) if name in cells
    ]  # fmt: skip
    for name in list(channels):
        values = array_of(content, name)
        if values is not None:
            mapped.append(f"{raw.topic}.{name}: {len(values)} values → {channels.pop(name)}")
    shown = {name for line in mapped for name in [line.partition("=")[0]]}
    rest = [f"{raw.topic}.{name}={value:.6g}" for name, value in cells.items()
            if f"{raw.topic}.{name}" not in shown]  # fmt: skip
    return "  ".join([rate, f"time {raw.topic}.{clock}", *mapped, *rest[:CELLS]])
