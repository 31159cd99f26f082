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
from typing import NamedTuple

import numpy as np

from evertwin.app.console import Progress
from evertwin.errors import UsageError, reason_of
from evertwin.fold import Chunk
from evertwin.service.site.site_plan import Plan, read_site
from evertwin.signals import conversion
from evertwin.sources.live.contract import Around, LiveSettings, LiveSource
from evertwin.sources.live.files.growing import GrowingSettings
from evertwin.sources.live.files.replay import ReplaySettings
from evertwin.sources.live.line import LineDown
from evertwin.sources.live.modbus.spec import ModbusSettings
from evertwin.sources.live.mqtt.spec import MqttSettings
from evertwin.sources.live.opcua.spec import OpcuaSettings
from evertwin.sources.live.registry import open_live
from evertwin.sources.live.trying import beside, some
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.starter import look

MOST = 100_000
"""Samples that are taken at most."""
CLOCK = "t [s]"
"""Column of the stamps, for machines that have none: those of the protocol, or of arrival."""


class Table(NamedTuple):
    """What a source said.

    >>> Table(["x"], np.zeros(1, np.int64), np.zeros((1, 1))).clock
    ''
    """

    names: list[str]
    t: np.ndarray
    """Stamps [ns]."""
    rows: np.ndarray
    clock: str = ""
    """Column of stamps that are the machine's own: its dates, or `CLOCK` where the protocol brings
    them; empty: they are of arrival."""


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
    for one, table in zip(spoken, tables, strict=True):
        file = around.folder / f"{plan.file.stem}_{one.source}.csv"
        if _written(file, table) and not isinstance(one, OpcuaSettings):
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
) -> list[Table]:  # fmt: skip
    """What each source says."""
    return await asyncio.gather(
        *(_one(one, columns[one.source], around, seconds) for one in sources)
    )


async def _one(
    settings: LiveSettings, columns: dict[str, str], around: Around, seconds: float
) -> Table:
    dates = await _dates(settings, columns, around, seconds)
    columns = {name: unit for name, unit in columns.items() if name != dates}
    source = _opened(settings, columns, around, dates)
    chunks = await _some(source, MOST, seconds, least=2)
    scales = [conversion(unit or "1") for unit in columns.values()]
    factor, offset = (np.array(side) for side in zip(*scales, strict=True))
    rows = (np.concatenate([one.v for one in chunks]) - offset) / factor
    headings = [f"{name} [{unit}]" if unit else name for name, unit in columns.items()]
    t = np.concatenate([one.t for one in chunks])
    order = np.argsort(t, kind="stable")
    by_protocol = isinstance(settings, OpcuaSettings) and not {"t", CLOCK} & {*columns}
    return Table(headings, t[order], rows[order], dates or CLOCK * by_protocol)


def _opened(
    settings: LiveSettings, columns: dict[str, str], around: Around, dates: str = ""
) -> LiveSource:
    """The source, stamped by the column of ``dates``, by its protocol, or by arrival."""
    own = bool(dates) or isinstance(settings, OpcuaSettings)
    raw = beside(settings) if own else dataclasses.replace(beside(settings), stamp="arrival")
    channels = {name: ChannelSpec(name, unit or "1") for name, unit in columns.items()}
    time = TimeSpec(dates, "iso") if dates else TimeSpec(CLOCK)
    source = open_live(raw, SourceSpec(settings.source, channels, time=time), around)
    source.open()
    return source


async def _some(source: LiveSource, most: int, seconds: float, least: int) -> list[Chunk]:
    """Samples of an open source.

    Raises:
        UsageError: nobody is there, or there are fewer than ``least``.
    """
    try:
        chunks = await some(source, most, seconds)
    except (LineDown, OSError, TimeoutError) as error:
        raise UsageError(f"source {source.name!r}: down: {reason_of(error)}") from None
    if sum(len(one.t) for one in chunks) < least:
        why = source.health.reason or "no samples"
        raise UsageError(f"source {source.name!r}: {why}, within {seconds:g} s")
    return chunks


async def _dates(
    settings: LiveSettings, columns: dict[str, str], around: Around, seconds: float
) -> str:
    """The column of messages that holds dates as text; empty: there is none."""
    if not isinstance(settings, MqttSettings) or settings.stamp == "arrival":
        return ""
    if len({part.topic or settings.topic for part in settings.columns.values()}) > 1:
        return ""  # they have no stamp in common
    heard = _opened(settings, columns, around)
    await _some(heard, 1, seconds, least=1)
    for column in columns:
        if f"{column}: not a number" in heard.health.noted:
            others = {name: unit for name, unit in columns.items() if name != column}
            if await _some(_opened(settings, others, around, column), 1, seconds, least=0):
                return column
    return ""


def _written(file: Path, table: Table) -> bool:
    """Writes a recording; True: no column tells the time, nor does the machine, and it has that of
    arrival."""
    said = np.isfinite(table.rows).any(axis=0)  # other text than dates is left out
    names = [name for name, one in zip(table.names, said, strict=True) if one]
    t, rows = table.t, table.rows[:, said]
    if not table.clock:
        fresh = np.r_[True, (rows[1:] != rows[:-1]).any(axis=1)]  # read twice in one of its cycles
        _write(file, names, rows[fresh])
        (seen, *_), _ = look([file])
        if seen.table.time is not None:
            return False
    stamps = [f"{one // 10**9}.{one % 10**9:09d}" for one in t.tolist()]
    if table.clock not in ("", CLOCK):
        days = np.datetime_as_string(t.astype("datetime64[ns]"))
        stamps = [f"{one}Z" for one in days.tolist()]
    _write(file, [table.clock or CLOCK, *names], rows, stamps)
    return not table.clock


def _write(file: Path, names: Sequence[str], rows: np.ndarray, stamps: Sequence[str] = ()) -> None:
    with file.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(names)
        for k, row in enumerate(rows.tolist()):
            cells = ["" if not np.isfinite(one) else f"{one:.15g}" for one in row]
            writer.writerow([*stamps[k : k + 1], *cells])
