"""A machine that somebody wants to add: sampled for some seconds, and a first twin of it.

What a person says of its columns (place, name, unit) is read from the machine as a twin would; the
samples go the way of ``evertwin init`` to a twin file, and the twin runs beside them once. Nothing
is kept, here or at the machine. Only models that need no file may be asked for.

>>> [one["name"] for one in roles("robot1d")]
['v', 'x']
"""

from __future__ import annotations

import asyncio
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
from fastapi import HTTPException
from pydantic import BaseModel, ConfigDict, Field

from evertwin.config import read
from evertwin.engine.process import run_alone
from evertwin.errors import ConfigError, EvertwinError, UsageError
from evertwin.machines.catalog import machine
from evertwin.models import Model
from evertwin.settings.writing import inline
from evertwin.signals.units import conversion
from evertwin.sources.live.contract import Around
from evertwin.sources.live.registry import open_live, read_settings
from evertwin.sources.live.trying import some
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.starter import Draft, Match, Proposal, answered, look, mapped, options_of
from evertwin.twin import Twin

LONGEST = 20.0
"""Seconds that a machine is sampled at most."""
MOST = 20_000
"""Samples that are taken at most."""
PATIENCE = 60.0
"""Seconds that the first twin may take."""
Kind: TypeAlias = Literal[
    "arm", "bicycle", "differential", "drive", "drive_force", "odometer", "omni", "robot1d",
    "thermal",
]  # fmt: skip
"""Models that are built from numbers alone."""
TimeUnit: TypeAlias = Literal[
    "s", "ms", "us", "ns", "min", "h", "iso", "dmy", "mdy", "clock", "auto"
]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,39}$")]
Line = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]+$")]


class Column(BaseModel):
    """One column of a machine.

    >>> Column(place="8:float32", name="speed", unit="m/s").place
    '8:float32'
    """

    model_config = ConfigDict(extra="forbid")
    place: Line
    """Modbus: ``8``, ``8:float32 swapped`` (words), ``input 8:int16 *0.1 !-32768`` (factor, and the
    number that means no value); MQTT: path in the message; OPC UA: node id."""
    name: Name
    unit: Annotated[str, Field(min_length=1, max_length=30)]


class Machine(BaseModel):
    """What to sample, and what kind of machine it is.

    >>> where = {"protocol": "mqtt", "topic": "lift/state"}
    >>> Machine(kind="drive", columns=[Column(place="x", name="position", unit="m")], **where).name
    'machine'
    """

    model_config = ConfigDict(extra="forbid")
    protocol: Literal["modbus", "mqtt", "opcua"]
    host: str = Field(default="127.0.0.1", max_length=255)
    port: int = Field(default=0, ge=0, le=65535)
    url: str = Field(default="", max_length=255)
    topic: str = Field(default="", max_length=200)
    device: int = Field(default=1, ge=0, le=255)
    """Modbus: the unit behind the address."""
    name: Name = "machine"
    kind: Kind
    columns: list[Column] = Field(min_length=1, max_length=64)
    """The one with the name ``t`` is its time."""
    seconds: float = Field(default=5.0, gt=0.0, le=LONGEST)

    @property
    def stamped(self) -> Column | None:
        """The column of its time."""
        return next((one for one in self.columns if one.name == "t"), None)

    @property
    def source(self) -> SourceSpec:
        """Its ``[[source]]``."""
        channels = {
            one.name: ChannelSpec(column=one.name, unit=one.unit)
            for one in self.columns if one.name != "t"
        }  # fmt: skip
        unit: Any = "s" if self.stamped is None else self.stamped.unit
        if unit not in get_args(TimeUnit):
            raise UsageError(f"t: {unit!r}: expected a unit of {', '.join(get_args(TimeUnit))}")
        return SourceSpec("log", channels, time=TimeSpec(column="t", unit=unit))

    @property
    def table(self) -> dict[str, Any]:
        """Its ``[[twin.source]]``."""
        told: dict[str, Any] = {"source": "log", "protocol": self.protocol}
        if self.protocol == "opcua":
            told["url"] = self.url
        else:
            told |= {"host": self.host} | ({"port": self.port} if self.port else {})
        told |= {"topic": self.topic} if self.protocol == "mqtt" else {}
        told |= {"device": self.device} if self.protocol == "modbus" and self.device != 1 else {}
        told |= {} if self.stamped else {"stamp": "arrival"}
        key = {"modbus": "registers", "mqtt": "columns", "opcua": "nodes"}[self.protocol]
        modbus = self.protocol == "modbus"
        places = {c.name: _register(c.place) if modbus else c.place for c in self.columns}
        return told | {key: places}


_PLACE = re.compile(
    r"(?:(?P<table>holding|input|coil|discrete) )?(?P<address>\d+)(?::(?P<type>\w+))?"
    r"(?P<swapped> swapped)?(?: \*(?P<scale>[-+.\deE]+))?(?: !(?P<sentinel>[-+.\deE]+))?"
)


def _register(place: str) -> dict[str, Any]:
    """A register as people write it.

    >>> _register("8:float32 swapped"), _register("input 3 *0.1 !65535")
    ({'address': 8, 'type': 'float32', 'word_order': 'little'},
     {'table': 'input', 'address': 3, 'scale': 0.1, 'sentinels': [65535.0]})
    """
    found = _PLACE.fullmatch(place)
    if found is None:
        raise UsageError(
            f"place {place!r}: expected as in 8, 8:float32 swapped, input 3:int16 *0.1 !-32768: "
            "table, address:type, words swapped, *factor, !number that means 'no value'"
        )
    told: dict[str, Any] = {"table": found["table"]} if found["table"] else {}
    told |= {"address": int(found["address"])}
    told |= {"type": found["type"]} if found["type"] else {}
    told |= {"word_order": "little"} if found["swapped"] else {}
    try:
        told |= {"scale": float(found["scale"])} if found["scale"] else {}
        return told | ({"sentinels": [float(found["sentinel"])]} if found["sentinel"] else {})
    except ValueError as error:
        raise UsageError(f"place {place!r}: {error}") from None


@cache
def roles(kind: Kind) -> Sequence[Mapping[str, str]]:
    """The channels of a model, as names that columns may have: name, unit, and in or out."""
    model: Model = machine(kind, answered(options_of(kind, None, Path())[0]))
    sides = (("input", model.inputs), ("output", model.outputs))
    return [{"name": c.name, "unit": c.unit, "side": side} for side, of in sides for c in of]


def kinds() -> Mapping[str, Sequence[Mapping[str, str]]]:
    """Every kind with its roles."""
    return {kind: roles(kind) for kind in get_args(Kind)}


async def added(asked: Machine) -> Mapping[str, Any]:
    """The machine's samples, the twin file and the entry of the site file, the first residual.

    Raises:
        UsageError: the columns do not say what they must.
        HTTPException: 502 where the machine gives nothing.
    """
    t, v = await _sampled(asked)
    columns = [(one.name, one.unit) for one in asked.columns if one.name != "t"]
    job = partial(first_twin, asked.name, asked.kind, columns, t, v)  # a model may take long
    found: Mapping[str, Any] = await asyncio.to_thread(run_alone, job, PATIENCE)
    newest = {name: float(x) if np.isfinite(x) else None for (name, _), x in zip(columns, v[-1])}
    seconds = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    twin, site = _timed(found["twin"], asked.source.time), _site(asked)
    return {
        **found,
        "twin": twin,
        "site": site,
        "newest": newest,
        "rows": len(t),
        "seconds": seconds,
    }


async def _sampled(asked: Machine) -> tuple[np.ndarray, np.ndarray]:
    """Seconds (n,), and the columns in the machine's own units (n, k)."""
    chosen: Any = {"client": f"evertwin-look-{os.getpid()}", "session": 1.0}
    table = {**asked.table, **(chosen if asked.protocol == "mqtt" else {})}
    try:
        source = open_live(read_settings(table, "machine"), asked.source, Around())
    except ConfigError as error:
        raise UsageError(str(error)) from error
    source.open()
    chunks = await some(source, MOST, asked.seconds)
    rows = sum(len(one.t) for one in chunks)
    if rows < 2:
        why = source.health.reason or f"{rows} samples within {asked.seconds:g} s"
        raise HTTPException(502, f"{asked.protocol}: {why}")
    t = np.concatenate([one.t for one in chunks])
    v = np.concatenate([one.v for one in chunks])
    scales = [conversion(one.unit) for one in asked.columns if one.name != "t"]
    factor, offset = (np.array(side) for side in zip(*scales, strict=True))
    return 1e-9 * (t - t[0]), (v - offset) / factor


def first_twin(
    name: str, kind: Kind, columns: Sequence[tuple[str, str]], t: np.ndarray, v: np.ndarray
) -> Mapping[str, Any]:
    """A twin file as ``evertwin init`` proposes it for these samples, and how far it is off.

    Args:
        name: of the twin.
        kind: of its model.
        columns: name and unit of each.
        t: seconds, (n,).
        v: in these units, (n, k).
    """
    with tempfile.TemporaryDirectory() as folder:
        log, file = Path(folder) / "log.csv", Path(folder) / f"{name}.toml"
        header = ",".join(["t [s]", *(f"{column} [{unit}]" for column, unit in columns)])
        np.savetxt(log, np.column_stack([t, v]), "%.17g", ",", header=header, comments="")
        try:
            seen, _ = look([log])
            drafts = [
                Draft(
                    file, kind, options, model, seen, _as_named(model, mapped(model, seen), columns)
                )
                for options in options_of(kind, None, file)
                for model in (machine(kind, answered(options)),)
            ]
        except EvertwinError as error:
            return {"twin": "", "questions": [str(error)], "residual": []}
        draft = min(drafts, key=lambda one: len(one.questions))
        text = draft.text()
        file.write_text(text, encoding="utf-8")
        told = {"twin": _live(text), "questions": list(draft.questions)}
        return {**told, **({"residual": []} if draft.questions else _residual(file, log))}


def _as_named(model: Model, proposal: Proposal, columns: Sequence[tuple[str, str]]) -> Proposal:
    """The proposal, with columns that a person gave a channel's name: also one that stood still,
    which nobody would guess."""
    there = {*model.inputs.names, *model.outputs.names}
    named = {name: unit for name, unit in columns if name in there}
    found = [Match(name, 0, name, unit, "as was named") for name, unit in named.items()]
    others = [m for m in proposal.matches if m.channel not in named and m.column not in named]
    return replace(
        proposal, matches=(*found, *others),
        missing=tuple(n for n in proposal.missing if n not in named),
        derivations=tuple(d for d in proposal.derivations if d.name not in named),
        unused=tuple(n for n in proposal.unused if n not in named),
    )  # fmt: skip


def _residual(file: Path, log: Path) -> Mapping[str, Any]:
    """How far the twin is off as it is proposed."""
    try:
        with Twin(read(file)) as twin:
            result = twin.run([log])
    except EvertwinError as error:
        return {"residual": [], "problem": str(error).replace(str(file.parent), "")}
    return {"residual": [
        {"output": name, "unit": one.unit, "rms": one.rms_before, "rows": one.rows}
        for name, one in result.outputs.items()
    ]}  # fmt: skip


def _live(text: str) -> str:
    """Without the recording that it was proposed for."""
    kept = [line for line in text.splitlines() if not line.startswith(("files = ", "match = "))]
    return "\n".join(["# Proposed for what the machine said: check columns and units.", *kept[1:]])


def _timed(text: str, time: TimeSpec) -> str:
    """With the machine's own time: what was sampled has seconds."""
    return text.replace('time = { column = "t", unit = "s" }',
                        f'time = {{ column = "t", unit = "{time.unit}" }}')  # fmt: skip


def _site(asked: Machine) -> str:
    """The entry of a site file."""
    lines = ["[[twin]]", f"file = {inline(f'{asked.name}.toml')}", "", "[[twin.source]]"]
    tables = {key: value for key, value in asked.table.items() if isinstance(value, Mapping)}
    flat = {key: value for key, value in asked.table.items() if key not in tables}
    lines += [f"{key} = {inline(value)}" for key, value in flat.items()]
    for key, table in tables.items():
        lines += ["", f"[twin.source.{key}]"]
        lines += [f"{name} = {inline(place)}" for name, place in table.items()]
    return "\n".join([*lines, ""])
