"""A version as a MAT file of version 5, which MATLAB, Octave and SciPy read.

Variables: ``evertwin`` (name, kind, version, hash), ``parameters`` (one field per parameter with
value, unit, low95, high95, verdict), and with trajectories ``t``, ``task`` and one column vector
per channel: inputs and measured outputs by their names, predictions as ``NAME_predicted``. A dot in
a name becomes two underscores, since MATLAB allows letters, digits and underscores alone;
``parameters.NAME.name`` keeps the name as it is.
"""

from __future__ import annotations

import io
import math
import re
from typing import Any

import numpy as np
import scipy

from evertwin.errors import UsageError
from evertwin.export.content import Exported

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
