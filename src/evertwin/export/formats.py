"""The formats that a model is exported in. A further one is one more entry of `FORMATS`.

A writer gets what is exported and the path, writes the file, and says in a line what it holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from evertwin.errors import UsageError
from evertwin.export.content import Exported
from evertwin.export.fmu import write_fmu
from evertwin.export.matlab import mat_bytes
from evertwin.export.modelica_text import json_text
from evertwin.export.urdf import urdf_bytes
from evertwin.files import write_whole

Writer = Callable[[Exported, Path], str | None]
"""Writes a file, or raises an error of `evertwin.errors` and writes nothing. What a reader of the
file has to know may come back as one sentence."""


@dataclass(frozen=True)
class Written:
    """A file that was written.

    >>> Written("json", Path("arm.json"), 1, 12).format
    'json'
    """

    format: str
    path: Path
    version: int
    parameters: int
    rows: int = 0
    note: str = ""
    """What a reader of the file has to know."""


def _of(made: Callable[[Exported], bytes]) -> Writer:
    def writer(out: Exported, path: Path) -> None:
        write_whole(path, made(out))

    return writer


FORMATS: dict[str, Writer] = {
    "fmu": write_fmu, "json": _of(json_text), "mat": _of(mat_bytes), "urdf": _of(urdf_bytes),
}  # fmt: skip
"""Format → writer."""


def write(out: Exported, form: str, path: Path) -> Written:
    """Writes ``out`` in a format.

    Raises:
        UsageError: there is no such format, or the model cannot be said in it.
    """
    if form not in FORMATS:
        raise UsageError(f"no format {form!r}: there are {', '.join(sorted(FORMATS))}")
    note = FORMATS[form](out, path) or ""
    rows = 0 if out.trajectories is None else len(out.trajectories.t)
    return Written(form, path, out.version.number, len(out.version.names), rows, note)
