"""``evertwin init site.toml``: a first twin file for machines that speak, not for recordings.

Each source of a twin that has no file yet is read as its map in the site file says, for some
seconds. What came is kept as a recording beside the twin file, in the machine's own numbers, and
goes the way of any recording: times, units and roles are told by what is there.
"""

from __future__ import annotations

import asyncio
import csv
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evertwin.app.console import Progress
from evertwin.errors import UsageError, reason_of
from evertwin.service.plan import Plan, read_site
from evertwin.signals import conversion
from evertwin.sources.live.contract import Around, LiveSettings
from evertwin.sources.live.growing import GrowingSettings
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.modbus_spec import ModbusSettings
from evertwin.sources.live.mqtt_spec import MqttSettings
from evertwin.sources.live.opcua_spec import OpcuaSettings
from evertwin.sources.live.registry import open_live
from evertwin.sources.live.replay import ReplaySettings
from evertwin.sources.live.trying import beside, some
from evertwin.sources.spec import ChannelSpec, SourceSpec
from evertwin.starter import look

MOST = 100_000
"""Samples that are taken at most."""
CLOCK = "t [s]"
"""Column of the times of arrival, for machines that say none."""


def first_without_file(site: Path, force: bool) -> Plan:
    """The first twin of a site file that has no twin file yet; with ``force`` the first of all.

    Raises:
        UsageError: each has one.
    """
    twins = read_site(site).twins
    found = next((one for one in twins if force or not one.file.exists()), None)
    if found is None:
        names = ", ".join(one.file.name for one in twins)
        raise UsageError(
            f"{site}: there already: {names}. Say --force to read the first machine and propose "
            f"its file anew; or next: evertwin doctor {site}"
        )
    if not found.sources:
        raise UsageError(f"{site}: {found.name} has no [[twin.source]]: say where it is heard")
    return found


def read_machine(plan: Plan, seconds: float) -> tuple[dict[Path, str], list[str]]:
    """Recordings by the name of their source, and what has to be said in the site file.

    Args:
        plan: the twin.
        seconds: for which its machines are read.

    Raises:
        UsageError: a source has no map yet, is not to be read so, or says nothing.
    """
    around, found, notes = Around(plan.file.parent), dict[Path, str](), list[str]()
    spoken = [one for one in plan.sources if not isinstance(one, GrowingSettings | ReplaySettings)]
    for one in plan.sources:
        found |= {file: one.source for file in _files(one, around) if one not in spoken}
    columns = {one.source: _columns(one) for one in spoken}
    with Progress(f"the machine is read for {seconds:g} s"):
        tables = asyncio.run(_together(spoken, columns, around, seconds))
    for one, (names, t, rows) in zip(spoken, tables, strict=True):
        file = around.folder / f"{plan.file.stem}_{one.source}.csv"
        if _written(file, names, t, rows) and not isinstance(one, OpcuaSettings):
            notes += [f'source {one.source!r} has no column of time: say stamp = "arrival" in its '
                      "[[twin.source]]"] * (one.stamp != "arrival")  # fmt: skip
        found[file] = one.source
    return found, notes


def _files(settings: LiveSettings, around: Around) -> list[Path]:
    """Of a source that is a file already."""
    if isinstance(settings, GrowingSettings):
        return [around.folder / settings.path]
    named = settings.files if isinstance(settings, ReplaySettings) else ()
    return [file for pattern in named for file in sorted(around.folder.glob(pattern))]


def _columns(settings: LiveSettings) -> dict[str, str]:
    """Columns of the map, with the units that it states.

    Raises:
        UsageError: there is no map.
    """
    who = f"source {settings.source!r}"
    if isinstance(settings, ModbusSettings):
        found = {name: one.unit or "" for name, one in settings.registers.items()}
    elif isinstance(settings, MqttSettings):
        found = dict.fromkeys(settings.columns, "")
    elif isinstance(settings, OpcuaSettings):
        found = dict.fromkeys(settings.nodes, "")
    else:
        raise UsageError(
            f"{who}: {settings.protocol} is not read by init: record it, and say init RECORDING"
        )
    if not found:
        key = {"modbus": "registers", "mqtt": "columns", "opcua": "nodes"}[settings.protocol]
        raise UsageError(
            f"{who}: nothing is mapped: name its columns in [twin.source.{key}]; what there is "
            "shows 'evertwin doctor SITE.toml'"
        )
    return found


async def _together(
    sources: Sequence[LiveSettings], columns: dict[str, dict[str, str]], around: Around,
    seconds: float,
) -> list[tuple[list[str], np.ndarray, np.ndarray]]:  # fmt: skip
    """Headings, times of arrival [ns] and rows of each source."""
    return await asyncio.gather(
        *(_one(one, columns[one.source], around, seconds) for one in sources)
    )


async def _one(
    settings: LiveSettings, columns: dict[str, str], around: Around, seconds: float
) -> tuple[list[str], np.ndarray, np.ndarray]:
    channels = {name: ChannelSpec(name, unit or "1") for name, unit in columns.items()}
    raw = dataclasses.replace(beside(settings), stamp="arrival")
    source = open_live(raw, SourceSpec(settings.source, channels), around)
    source.open()
    try:
        chunks = await some(source, MOST, seconds)
    except (LineDown, OSError, TimeoutError) as error:
        raise UsageError(f"source {settings.source!r}: down: {reason_of(error)}") from None
    if sum(len(one.t) for one in chunks) < 2:
        why = source.health.reason or "no samples"
        raise UsageError(f"source {settings.source!r}: {why}, within {seconds:g} s")
    scales = [conversion(one.unit) for one in channels.values()]
    factor, offset = (np.array(side) for side in zip(*scales, strict=True))
    rows = (np.concatenate([one.v for one in chunks]) - offset) / factor
    headings = [f"{name} [{unit}]" if unit else name for name, unit in columns.items()]
    return headings, np.concatenate([one.t for one in chunks]), rows


def _written(file: Path, names: Sequence[str], t: np.ndarray, rows: np.ndarray) -> bool:
    """Writes a recording; with the times of arrival, and True, where no column tells the time."""
    said = np.isfinite(rows).any(axis=0)  # text is left out
    names, rows = [name for name, one in zip(names, said, strict=True) if one], rows[:, said]
    fresh = np.r_[True, (rows[1:] != rows[:-1]).any(axis=1)]  # read twice in one of its cycles
    _write(file, names, rows[fresh])
    (seen, *_), _ = look([file])
    if seen.table.time is not None:
        return False
    stamps = [f"{one // 10**9}.{one % 10**9:09d}" for one in t.tolist()]
    _write(file, [CLOCK, *names], rows, stamps)
    return True


def _write(file: Path, names: Sequence[str], rows: np.ndarray, stamps: Sequence[str] = ()) -> None:
    with file.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(names)
        for k, row in enumerate(rows.tolist()):
            cells = ["" if not np.isfinite(one) else f"{one:.15g}" for one in row]
            writer.writerow([*stamps[k : k + 1], *cells])
