"""The formats that a model is exported in. A further one is one more entry of `FORMATS`.

A writer gets what is exported and the path, writes the file, and says in a line what it holds.

JSON, ``schema: "evertwin.model/1"``: form, parameters with intervals, channels.

MAT, version 5, which MATLAB, Octave and SciPy read: ``evertwin`` (name, kind, version, hash),
``parameters`` (one field per parameter with value, unit, low95, high95, verdict), and with
trajectories ``t``, ``task`` and one column vector per channel: inputs and measured outputs by their
names, predictions as ``NAME_predicted``. A dot in a name becomes two underscores, since MATLAB
allows letters, digits and underscores alone;
``parameters.NAME.name`` keeps the name as it is.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from evertwin.errors import UsageError
from evertwin.export.aas import write_aas
from evertwin.export.content import Exported
from evertwin.export.fmu import write_fmu
from evertwin.export.urdf import urdf_bytes
from evertwin.files import write_whole
from evertwin.fold import plain
from evertwin.types import Json

LONGEST = 63
"""Characters of a MATLAB name."""


def identifier(name: str) -> str:
    """A name that MATLAB allows.

    >>> identifier("law.v#2.gain"), identifier("2nd")
    ('law__v_2__gain', 'x2nd')
    """
    word = re.sub(r"[^A-Za-z0-9_]", "_", name.replace(".", "__"))
    return (word if word[:1].isalpha() else f"x{word}")[:LONGEST]


def mat_bytes(out: Exported) -> bytes:
    """The file's content.

    Raises:
        UsageError: two names become the same.
    """
    version = out.version
    content: dict[str, Any] = {
        "evertwin": {
            "schema": "evertwin.model/1", "name": out.name, "kind": out.kind,
            "version": float(version.number), "hash": version.hash, "reason": version.reason,
        },
        "parameters": _named({name: _row(name, item) for name, item in out.parameters.items()}),
    }  # fmt: skip
    rows = out.trajectories
    if rows is not None:
        columns = {"t": rows.t, "task": rows.task.astype(np.float64)}
        columns |= dict(zip(out.model.inputs.names, rows.inputs.T, strict=True))
        columns |= dict(zip(out.model.outputs.names, rows.measured.T, strict=True))
        predicted = [f"{name}_predicted" for name in out.model.outputs.names]
        columns |= dict(zip(predicted, rows.predicted.T, strict=True))
        content |= _named({name: value[:, None] for name, value in columns.items()})
    with io.BytesIO() as buffer:
        target: Any = buffer  # savemat writes to files, its stub knows names alone
        scipy.io.savemat(target, content, long_field_names=True, oned_as="column")
        return buffer.getvalue()


def _row(name: str, item: dict[str, Any]) -> dict[str, Any]:
    low, high = item["interval95"] or (math.nan, math.nan)
    return {
        "name": name, "value": item["value"], "unit": item["unit"], "low95": low, "high95": high,
        "verdict": item["verdict"],
    }  # fmt: skip


def _named(items: dict[str, Any]) -> dict[str, Any]:
    names = [identifier(name) for name in items]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"mat: two names become {name!r} in MATLAB: rename one, or use json")
    return dict(zip(names, items.values(), strict=True))


SCHEMA = "evertwin.model/1"


def document(out: Exported) -> dict[str, Json]:
    """Plain content; infinities are None."""
    version = out.version
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "name": out.name,
        "model": {"kind": out.kind, "options": out.options, "variant": dict(version.form.variant)},
        "version": {
            "number": version.number, "hash": version.hash, "parent": version.parent,
            "reason": version.reason,
        },
        "terms": version.form.terms,
        "inputs": out.channels(out.model.inputs),
        "outputs": out.channels(out.model.outputs),
        "states": out.channels(out.base.states),
        "parameters": out.parameters,
    }  # fmt: skip
    rows = out.trajectories
    if rows is not None:
        content["trajectories"] = {
            "t": rows.t,
            "task": rows.task,
            "inputs": dict(zip(out.model.inputs.names, rows.inputs.T, strict=True)),
            "measured": dict(zip(out.model.outputs.names, rows.measured.T, strict=True)),
            "predicted": dict(zip(out.model.outputs.names, rows.predicted.T, strict=True)),
        }
    return plain(content)  # type: ignore[return-value]


def json_text(out: Exported) -> bytes:
    """The file's content."""
    return (json.dumps(document(out), indent=2, ensure_ascii=False) + "\n").encode()


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
    "aas": write_aas, "fmu": write_fmu, "json": _of(json_text), "mat": _of(mat_bytes),
    "urdf": _of(urdf_bytes),
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
