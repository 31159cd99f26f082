"""Roll-outs in other processes: each builds the model once and keeps it."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.models import Restart
from evertwin.models.batch import Batch
from evertwin.tuning.posing.settings import Far
from evertwin.types import Float64, Inputs, Intervals

KEPT = 8
"""Models that a process keeps."""
_BUILT: dict[str, Batch] = {}
"""What this process has built, by key."""


def far_runs(
    far: Far, u: Inputs, dt: Intervals, p: Float64[np.ndarray, "k np"], restart: Restart
) -> Float64[np.ndarray, "k n ny"]:
    """`Batch.run`, its parameter vectors spread over the processes of ``far``.

    >>> from evertwin.models import FunctionModel
    >>> from evertwin.signals import Layout
    >>> def still():
    ...     return FunctionModel(lambda x, u, dt, p: ([], u), Layout.of(u="1"), Layout.of(y="1"))
    >>> far = Far(lambda f, items: [f(i) for i in items], still, "still")
    >>> rows = np.ones((1, 1)), np.ones(1), np.zeros((3, 0)), Restart.never(1, 1)
    >>> far_runs(far, *rows).ravel().tolist()
    [1.0, 1.0, 1.0]
    """
    parts = np.array_split(p, min(far.workers, len(p)))
    return np.concatenate(far.map(_part, [(far.build, far.key, u, dt, q, restart) for q in parts]))


def _part(item: tuple[Any, ...]) -> Any:
    build, key, u, dt, p, restart = item
    if key not in _BUILT:
        if len(_BUILT) >= KEPT:
            _BUILT.clear()
        _BUILT[key] = Batch(build())
    return _BUILT[key].run(u, dt, p, restart)
