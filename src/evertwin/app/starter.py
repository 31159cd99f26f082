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

    def text(self) -> str:
        parts = [
            self._head(), self._model(), self._source(), self._derive(), self._clock(),
            self._rules(), self._learning(),
        ]  # fmt: skip
        return "\n".join(line for part in parts for line in part) + "\n"

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

    def _head(self) -> list[str]:
        return [
            f"# Proposed by evertwin init from {self.file.name}: check columns and units.",
            "#", f"#   evertwin doctor {self.out.name}", f"#   evertwin run {self.out.name}",
            "schema = 1", f"name = {_toml(self.out.stem)}",
        ]  # fmt: skip

    def _model(self) -> list[str]:
        lines = ["", "[model]", f"kind = {_toml(self.kind)}"]
        if self.options:
            shown = {k: self._relative(k, v) for k, v in self.options.items()}
            inner = ", ".join(f"{k} = {_toml(v)}" for k, v in shown.items())
            lines.append(f"options = {{ {inner} }}")
        if self.model is None:
            return [*lines, "# Start values and bounds: [model.parameters] gain = { value = 1 }"]
        lines += ["# What differs from the model's own values, for example:"]
        first = self.model.parameters.items[0]
        entry = f"{first.name} = {{ value = {first.value:g}, unit = {_toml(first.unit)} }}"
        return [*lines, "# [model.parameters]", f"# {entry}"]

    def _relative(self, key: str, value: Any) -> Any:
        if key == "urdf" and str(value).endswith(".urdf"):
            return os.path.relpath(Path(value).resolve(), self.out.resolve().parent)
        return value

    def _source(self) -> list[str]:
        path = os.path.relpath(self.file.resolve(), self.out.resolve().parent)
        lines = [
            "", "[[source]]", 'name = "log"', f"files = [{_toml(path)}]", *self._time(), "",
            "[source.channels]",
        ]  # fmt: skip
        for match in self.proposal.matches:
            name, column = match.channel, _toml(_column(match.column))
            entry = f"{name} = {{ column = {column}, unit = {_toml(match.unit)} }}"
            lines.append(f"{entry}  # {match.reason}")
        for name in self.missing:
            unit = self.layout.channels[self.layout.index(name)].unit
            entry = f'{name} = {{ column = "?", unit = {_toml(unit)} }}'
            lines.append(f"{entry}  # no column was found")
        return lines

    def _time(self) -> list[str]:
        time = self.table.time
        if time is not None:
            sure = "" if time.sure else f"  # {time.reason}: please check"
            column = _toml(_column(time.column))
            return [f"time = {{ column = {column}, unit = {_toml(time.unit)} }}{sure}"]
        if self.period is not None:
            rate = f"{1.0 / self.period:.6g} Hz"
            return [f"time = {{ rate = {_toml(rate)} }}  # no column is a time: please check"]
        return [
            '# No column of time was found: how many rows are there in a second? As in "100 Hz".',
            'time = { rate = "?" }',
        ]

    def _derive(self) -> list[str]:
        lines: list[str] = []
        for name in self.derived:
            lines += ["", "[[derive]]", f'name = "{name}"', 'op = "derivative"',
                      f'from = ["qd{name[3:]}"]']  # fmt: skip
        return lines

    def _clock(self) -> list[str]:
        if self.rate is None:
            return ["", "[clock]", "# The longest interval that is simulated over.",
                    'gap = "10 s"']  # fmt: skip
        lines = ["", "[clock]", "# Rows at a fixed rate: derivatives and filters need them.",
                 f'rate = "{self.rate:g} Hz"']  # fmt: skip
        if self.rate >= 25:
            lines += ["", "[filter]", "# Over measurement and prediction alike.",
                      f'cutoff = "{min(5.0, self.rate / 5):g} Hz"']  # fmt: skip
        return lines

    def _rules(self) -> list[str]:
        return self._static_rules() if self.static else [
            "", "[arbiter]", "# Adopt a measurement when the twin is off by more than a tolerance:",
            '# use = "tolerance"', '# tolerance = "2 cm"', "", "[prediction]",
            "# Models are compared on predictions this long, each from the measured state.",
            f'horizon = "{self._horizon():g} s"', "", "[anomaly]",
            "# Suspected when such a prediction is off by more than this; without it nothing is.",
            '# requirement = "1 cm"',
        ]  # fmt: skip

    def _static_rules(self) -> list[str]:
        lines = [
            "", "[arbiter]", "# Wide, until the model's friction is known.", "gate = 12.0", "",
            "[anomaly]", "# Suspected when an output is off by this share of its rms.",
            "requirement = 0.05", "", "[prediction]", "# Losses are compared second by second.",
            'horizon = "1 s"',
        ]  # fmt: skip
        torques = [name for name in self.layout.names if name.startswith("tau")]
        if not torques:
            return lines
        deciders = [f'{name} = "qd{name[3:]}"' for name in torques]
        lines += ["", "[moving]", "# At standstill friction is undetermined.", "above = 0.05"]
        return [*lines, "[moving.channels]", *deciders]

    def _horizon(self) -> float:
        period = self.period or 0.01
        return max(1.0, float(f"{10 ** math.ceil(math.log10(10 * period)):g}"))

    def _learning(self) -> list[str]:
        lines = ["", "[tuning]", "# What may be tuned; without it what the model proposes."]
        names = ("gain", "time_constant") if self.model is None else self.model.parameters.editable
        lines.append(f"# editable = [{', '.join(_toml(n) for n in names[:6])}]")
        return [
            *lines, "", "[correction]", "# What may be corrected when tuning is not enough:",
            '# channels = ["INPUT"]', '# terms = ["lag", "table", "law"]', "", "[store]",
            "# Keeps versions, events and checkpoints; without it they are gone after the run.",
            f'# path = "{self.out.stem}.db"',
        ]  # fmt: skip


def _column(name: str) -> str | int:
    """A column without a heading goes by its position."""
    found = re.fullmatch(r"c(\d+)", name)
    return int(found[1]) - 1 if found else name


def _toml(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
