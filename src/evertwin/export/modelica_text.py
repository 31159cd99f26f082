"""A version as JSON, ``schema: "evertwin.model/1"``: form, parameters with intervals, channels."""

from __future__ import annotations

import json
from typing import Any

from evertwin.export.content import Exported
from evertwin.fold import plain
from evertwin.types import Json

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
