"""Does the map of a source fit its machine? Read for seconds as a twin would; nothing is kept.

What is said before any machine is asked (a column that is misspelt, no column of time), what cannot
be read, what never comes, and values that no such machine has.
"""

from __future__ import annotations

import asyncio
import dataclasses
import math
import os
from collections.abc import Mapping

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.sources.live.contract import Around, LiveSettings, LiveSource
from evertwin.sources.live.modbus.spec import ModbusSettings
from evertwin.sources.live.mqtt.connection import LISTEN
from evertwin.sources.live.mqtt.source import Mqtt
from evertwin.sources.live.mqtt.spec import MqttSettings
from evertwin.sources.live.opcua.spec import OpcuaSettings
from evertwin.sources.live.registry import open_live
from evertwin.sources.spec import ArraySpec, SourceSpec

AGAIN = 3.0
"""Seconds after which what reads is told once more to end."""
ENOUGH = 5
"""Samples that tell whether a map fits."""


async def misfits(
    settings: LiveSettings, spec: SourceSpec | ArraySpec, around: Around,
    bounds: Mapping[str, tuple[float, float]],
) -> list[str]:  # fmt: skip
    """What does not fit, in sentences; nothing where there is no map yet.

    Args:
        settings: of the source, as the site file has them.
        spec: as the twin file has it.
        around: what paths are relative to.
        bounds: what is possible of a channel, in SI.

    Raises:
        LineDown, OSError, TimeoutError: nobody is there.
    """
    if not _mapped(settings):
        return []
    try:
        source = open_live(beside(settings), spec, around)
        source.open()
    except UsageError as error:
        return [str(error)]
    chunks = await some(source, ENOUGH, LISTEN)
    health, found = source.health, list[str]()
    found += [
        f"{count} × {health.reason if health.reason.endswith(why) else why}"
        for why, count in health.rejected.items()
    ]
    found += [health.hint] if health.hint else []
    if not chunks:
        found += [] if found else [health.reason or await _silent(source)]
    elif isinstance(spec, SourceSpec):
        found += _values(spec, np.concatenate([chunk.v for chunk in chunks]), bounds)
    return found


async def some(source: LiveSource, most: int, seconds: float) -> list[Chunk]:
    """About ``most`` samples of an open source, or what comes in so many seconds; it is closed."""
    chunks = list[Chunk]()

    async def read() -> None:
        async for chunk in source.chunks():
            source.committed(chunk)
            chunks.append(chunk)
            if sum(len(one.t) for one in chunks) >= most:
                break

    task = asyncio.create_task(read())
    try:
        await asyncio.wait({task}, timeout=seconds)
        while not task.done():  # Python 3.11 loses one that comes with what was waited for
            task.cancel()
            await asyncio.wait({task}, timeout=AGAIN)
    finally:
        task.cancel()
        source.close()
    if not task.cancelled():
        task.result()
    return chunks


def _mapped(settings: LiveSettings) -> bool:
    """Is there a map to look at?"""
    if isinstance(settings, ModbusSettings):
        return bool(settings.registers)
    if isinstance(settings, OpcuaSettings):
        return bool(settings.nodes)
    return isinstance(settings, MqttSettings) and bool(settings.topic or settings.columns)


def beside(settings: LiveSettings) -> LiveSettings:
    """The same under a name of its own: the session of a twin at work is not touched.

    >>> beside(MqttSettings("log", "mqtt", client="plant")).client.startswith("evertwin-try-")
    True
    """
    if not isinstance(settings, MqttSettings):
        return settings
    return dataclasses.replace(
        settings, client=f"evertwin-try-{os.getpid()}-{settings.source}", session=1.0, will=None
    )


async def _silent(source: LiveSource) -> str:
    """That nothing came, and what does."""
    said = f"nothing came within {LISTEN:.0f} s"
    if not isinstance(source, Mqtt):
        return said
    others = (await source.heard(LISTEN)).like(source.topics) or "nothing on any topic"
    return f"{said} on {', '.join(source.topics)}; what the broker sends: {others}"


def _values(
    spec: SourceSpec, v: np.ndarray, bounds: Mapping[str, tuple[float, float]]
) -> list[str]:
    """Channels that have no value in any sample, or none that is possible."""
    found = []
    for k, (name, channel) in enumerate(spec.channels.items()):
        own = v[np.isfinite(v[:, k]), k]
        low, high = bounds.get(name, (-math.inf, math.inf))
        if not len(own):
            found.append(f"{name}: no value of {channel.column!r} in any of {len(v)} samples")
        elif not ((own >= low) & (own <= high)).any():
            found.append(
                f"{name}: {own[-1]:.3g} in SI, outside of what is possible, {low:g} to {high:g}: "
                "look at its type, unit and order of words"
            )
    return found
