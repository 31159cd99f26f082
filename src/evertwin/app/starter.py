"""A first twin file for a recording: which column feeds which channel, and settings to begin with.

What could not be told from the recording is marked in the file and named on stderr. Nothing is
invented: a channel without a column gets the column ``"?"``, rows without a time the rate ``"?"``,
which a run refuses by name.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import typer
from jinja2 import Environment, PackageLoader

from evertwin.app.console import show
from evertwin.config import read
from evertwin.errors import DataError, UsageError
from evertwin.files import write_whole
from evertwin.loop.configured_model import model_of
from evertwin.machines.catalog import machine
from evertwin.models import Model
from evertwin.signals import Layout
from evertwin.sources.description import ColumnInfo, Info, TableInfo
from evertwin.sources.info import inspect
from evertwin.sources.names import unit_problem
from evertwin.sources.proposal import Match, Proposal, propose

PERIODS = ("ts", "dt", "t_s", "sampling_time", "sample_time")
"""Names of a column that holds one number: seconds from row to row."""


def write_starter(
    file: Path, out: Path, model: tuple[str, Path | None], force: bool, as_json: bool
) -> None:
    """``evertwin init``: writes the twin file, and for ``python`` a model file beside it.

    Raises:
        UsageError: there is a file already, or the model does not exist.
        DataError: the recording cannot be read, or holds no column of numbers.
    """
    if out.exists() and not force:
        raise UsageError(f"{out}: exists already: choose another name, or say --force")
    if not file.exists():
        raise DataError(f"{file}: no such file")
    info = inspect(file)
    table = max(info.tables, key=lambda one: one.rows * len(one.columns), default=None)
    if table is None or table.rows == 0:
        raise DataError(f"{file}: holds no complete row: look at it with evertwin info")
    kind, urdf = model
    own = out.with_name(f"{re.sub(r'[^A-Za-z0-9_]', '_', out.stem)}_model.py")
    options = _options(kind, urdf, own)
    if kind == "python":
        found, proposal = None, _first_two(table)
    else:
        built = machine(kind, options if urdf is None else {"urdf": str(urdf)})
        found, proposal = built, propose(info, built.inputs + built.outputs)
    draft = _Draft(out, file, info, table, kind, options, found, proposal)
    write_whole(out, draft.text())
    if kind == "python" and (force or not own.exists()):
        template = files("evertwin.app").joinpath("templates", "model.py.txt")
        write_whole(own, template.read_text("utf-8"))
    if draft.period is not None:  # else the file holds a question, which no reader takes
        model_of(read(out))
    content: dict[str, Any] = {
        "schema": "evertwin.init/1", "file": str(out),
        "model_file": str(own) if kind == "python" else None,
        "channels": {m.channel: m for m in proposal.matches}, "derived": draft.derived,
        "missing": draft.missing, "unused": proposal.unused,
    }  # fmt: skip
    show(content, draft.summary(), as_json)
    for name in draft.missing:
        typer.echo(f"evertwin: no column was found for {name}: name it in {out}", err=True)
    if draft.period is None:
        typer.echo(
            f"evertwin: no column of time was found: say in {out} how many rows there are in a "
            "second (rate)", err=True,
        )  # fmt: skip
    units = {column.name: column.unit for one in info.tables for column in one.columns}
    for match in proposal.matches:
        problem = unit_problem(units[match.column])
        if problem:
            typer.echo(
                f"evertwin: {file.name}: column {match.column!r}: the unit {problem}: {out} takes "
                f"its numbers as '{match.unit}'", err=True,
            )  # fmt: skip


def _options(kind: str, urdf: Path | None, own: Path) -> dict[str, Any]:
    if urdf is not None and kind != "arm":
        raise UsageError(f"--urdf is for --model arm, got --model {kind}")
    if kind == "python":
        return {"file": own.name, "name": "model"}
    if kind != "arm":
        return {}
    return {"urdf": "ur5_like" if urdf is None else str(urdf)}


def _first_two(table: TableInfo) -> Proposal:
    """For a model of one's own: the first column that varies drives, the next one answers.

    A column whose name begins as inputs (u, in) or outputs (y, out) are called goes before others.

    Raises:
        DataError: there are fewer than two columns of numbers.
    """
    clocks = {clock.column for clock in table.clocks}
    clocks |= set() if table.time is None else {table.time.column}
    columns = [c for c in table.columns if c.kind in ("number", "boolean") and c.name not in clocks]
    if len(columns) < 2:
        raise DataError("expected two columns of numbers beside the time: an input and an output")
    columns.sort(key=lambda c: c.low == c.high)  # what is constant can drive nothing
    drives = min(columns, key=lambda c: (_called(c, "y", "out"), not _called(c, "u", "in")))
    answers = min((c for c in columns if c is not drives), key=lambda c: not _called(c, "y", "out"))
    matches = tuple(
        Match(name, table.name, column.name, _unit(column), 0.0, "assumed: by its name or place")
        for name, column in (("u", drives), ("y", answers))
    )
    rest = tuple(c.name for c in columns if c is not drives and c is not answers)
    return Proposal(matches, (), rest)


def _called(column: ColumnInfo, *starts: str) -> bool:
    return column.low != column.high and column.name.lower().startswith(starts)


def _unit(column: ColumnInfo) -> str:
    """The unit that the file states, where it is one."""
    return column.unit if column.unit and not unit_problem(column.unit) else "1"


@dataclass(frozen=True)
class _Draft:
    """All that the text is made of."""

    out: Path
    file: Path
    info: Info
    table: TableInfo
    kind: str
    options: Mapping[str, Any]
    model: Model | None
    proposal: Proposal

    @property
    def layout(self) -> Layout:
        return Layout() if self.model is None else self.model.inputs + self.model.outputs

    @property
    def static(self) -> bool:
        return self.model is not None and len(self.model.states) == 0

    @property
    def derived(self) -> tuple[str, ...]:
        """Accelerations whose velocity was found."""
        known = {match.channel for match in self.proposal.matches}
        return tuple(
            n for n in self.proposal.missing if n.startswith("qdd") and f"qd{n[3:]}" in known
        )

    @property
    def missing(self) -> tuple[str, ...]:
        return tuple(n for n in self.proposal.missing if n not in self.derived)

    @property
    def period(self) -> float | None:
        """Seconds from row to row: of the column of time, or what a constant column says."""
        if self.table.time is not None:
            return self.table.time.period
        said = (c.low for c in self.table.columns if c.name.lower() in PERIODS and c.low == c.high)
        return next((value for value in said if value > 0.0), None)

    @property
    def rate(self) -> float | None:
        """Rate to resample to: where derivatives or a filter need one."""
        if not self.static or self.period is None or not self.period > 0:
            return None
        return float(f"{1.0 / self.period:.3g}")

    @property
    def horizon(self) -> float:
        """Of predictions [s]: ten rows or more, a power of ten."""
        period = self.period or 0.01
        return max(1.0, float(f"{10 ** math.ceil(math.log10(10 * period)):g}"))

    def text(self) -> str:
        environment = Environment(
            loader=PackageLoader("evertwin.app", "templates"), trim_blocks=True,
            lstrip_blocks=True, keep_trailing_newline=True,
        )  # fmt: skip
        environment.filters |= {"toml": _toml, "column": _column}
        model, here = self.model, self.out.resolve().parent
        options = dict(self.options)
        if str(options.get("urdf", "")).endswith(".urdf"):
            options["urdf"] = os.path.relpath(Path(options["urdf"]).resolve(), here)
        names = ("gain", "time_constant") if model is None else model.parameters.editable
        return environment.get_template("starter.toml.txt").render(
            draft=self, model=model, time=self.table.time,
            options=", ".join(f"{k} = {_toml(v)}" for k, v in options.items()),
            recording=os.path.relpath(self.file.resolve(), here),
            units={channel.name: channel.unit for channel in self.layout},
            editable=", ".join(map(_toml, names[:6])),
        )  # fmt: skip

    def summary(self) -> str:
        lines = [f"{self.out}: {self.kind}, {len(self.proposal.matches)} channels found"]
        lines += [f"  {m.channel:<10} {m.column:<20} {m.unit:<8} {m.reason}"
                  for m in self.proposal.matches]  # fmt: skip
        lines += [f"  {name:<10} derived" for name in self.derived]
        lines += [f"  {name:<10} no column found" for name in self.missing]
        if self.proposal.unused:
            lines.append(f"  not used: {', '.join(self.proposal.unused)}")
        lines.append(f"next: evertwin doctor {self.out}")
        return "\n".join(lines)


def _column(name: str) -> str:
    """A column without a heading goes by its position."""
    found = re.fullmatch(r"c(\d+)", name)
    return _toml(int(found[1]) - 1 if found else name)


def _toml(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
