"""Two versions of a twin over the same newest rows: on one axis, and run against run.

Each run is one task of the machine; where there is but one, it is cut into stretches of as many
rows:

>>> stretches([100], 4)
[(0, 25), (25, 50), (50, 75), (75, 100)]
>>> stretches([30, 50], 4)
[(0, 30), (30, 80)]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from evertwin.config import TwinSpec
from evertwin.errors import DataError, UsageError
from evertwin.fold import Block, plain
from evertwin.service.twin.questions import reading
from evertwin.signals.sizes import rms_of

STRETCHES = 8
"""Parts of the rows, where all are of one task."""


class Pair(NamedTuple):
    """Two versions and the output that is drawn.

    >>> Pair(0, 1, "x").b
    1
    """

    a: int
    b: int
    signal: str


def stretches(lengths: Sequence[int], count: int = STRETCHES) -> list[tuple[int, int]]:
    """First row of each run and the row behind it."""
    if len(lengths) == 1:
        edges = [k * lengths[0] // count for k in range(count + 1)]
    else:
        edges = [0, *np.cumsum(lengths).tolist()]
    return [(first, last) for first, last in pairwise(edges) if last > first]


def compared(spec: TwinSpec, blocks: Sequence[Block], pair: Pair) -> Mapping[str, Any]:
    """In plain values: measured and what both predict over the twin's horizon of one output; of
    each run the rms of all outputs by both.

    Raises:
        DataError: there are no rows.
        UsageError: there is no such version, or no such output.
    """
    if not any(len(block.t) for block in blocks):
        raise DataError("no rows yet")
    with reading(spec) as twin:
        names, units = twin.model.outputs.names, twin.model.outputs.units
        if pair.signal not in names:
            raise UsageError(f"no output {pair.signal!r}; there are {', '.join(names)}")
        found, k = twin.compare(pair.a, pair.b, blocks), names.index(pair.signal)
    one = found.predictions[0]
    t = np.concatenate([each.window.t for each in one])
    residual = [np.concatenate([p.residual for p in both]) for both in found.predictions]
    tells = [np.concatenate([p.predicted[:, k] for p in both]) for both in found.predictions]
    return plain({
        "a": pair.a, "b": pair.b, "signal": pair.signal, "t": t.tolist(),
        "measured": np.concatenate([p.measured[:, k] for p in one]).tolist(),
        "predicted": [p.tolist() for p in tells], "better": found.better,
        "residual": [r[:, k].tolist() for r in residual],
        "units": dict(zip(names, units, strict=True)),
        "runs": [
            {"first": int(t[i]), "last": int(t[j - 1]), "rows": j - i,
             "rms": {name: [rms_of(r[i:j, o]) for r in residual] for o, name in enumerate(names)}}
            for i, j in stretches([len(each.window.t) for each in one])
        ],
    })  # type: ignore[return-value]  # fmt: skip
