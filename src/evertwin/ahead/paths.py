"""A new path as inputs to come: from a file, or from the moves of an arm.

A file names the model's inputs in its headings, with ``t`` [s], and may hold outputs as they are
meant to be; what an arm's file leaves out of speed and acceleration is taken from the positions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from evertwin.ahead.future import Future
from evertwin.ahead.spec import PathSpec
from evertwin.errors import DataError, UsageError
from evertwin.machines.arm.chain import Chain
from evertwin.machines.assembly.path import Limits, moves_of, plan
from evertwin.models import Model
from evertwin.models.corrected import Corrected
from evertwin.signals import Layout
from evertwin.sources.small_table import Table, read_table
from evertwin.types import Vector

ACCELERATION = 2.0
"""Highest acceleration of a joint where nothing is said [rad/s²]."""
SPEED = 3.0
"""Highest speed of a joint that the description does not limit [rad/s]."""


def inner(model: Model) -> Any:
    """The machine's own model, without the correction terms around it."""
    found: Any = model
    while isinstance(found, Corrected):
        found = found.model
    return found


def chain_of(model: Model) -> Chain | None:
    """The geometry of an arm, or of an assembly around one; None for other machines."""
    model = inner(model)
    found = getattr(model, "chain", None) or getattr(getattr(model, "train", None), "chain", None)
    return found if isinstance(found, Chain) else None


def rows_of_file(model: Model, path: Path) -> tuple[Future, Mapping[str, Vector]]:
    """Inputs to come, and the outputs that the file plans.

    Raises:
        DataError: a column lacks, the time does not rise, or a cell is empty.
    """
    table = read_table(path)
    t = table.column("t")
    if len(t) < 2 or not np.all(np.diff(t) > 0.0):
        raise DataError(f"{path}: expected two rows or more with a rising t [s]")
    columns = [_input(table, t, name) for name in model.inputs.names]
    u = np.ascontiguousarray(np.stack(columns, axis=1))
    if not np.isfinite(u).all():
        row, column = (int(k[0]) for k in np.nonzero(~np.isfinite(u)))
        raise DataError(f"{path}: row {row + 1} lacks {model.inputs.names[column]}")
    dt = np.diff(t, prepend=t[0] - (t[1] - t[0]))
    planned = {name: table.column(name) for name in model.outputs.names if name in table.names}
    return Future(u, dt), planned


def _input(table: Table, t: Vector, name: str) -> Vector:
    """A column, or a derivative of the arm's position ``q…``."""
    order = 2 if name.startswith("qdd") else 1 if name.startswith("qd") else 0
    if name in table.names or order == 0:
        return table.column(name)
    spline: Any = scipy.interpolate.CubicSpline(t, table.column("q" + name[order + 1 :]))
    return np.asarray(spline(t, order))


def motion_of_moves(path: PathSpec, chain: Any, start: Sequence[float], inputs: Layout) -> Future:
    """The motion through an arm's moves as inputs to come."""
    top = [speed if math.isfinite(speed) else SPEED for _, _, speed in chain.limits]
    limits = Limits(path.speed or tuple(top), path.acceleration or (ACCELERATION,) * chain.n)
    program: Any = path.moves
    motion = plan(moves_of(program), start, limits, path.rate, path.profile, chain)
    u = np.concatenate([motion.q, motion.qd, motion.qdd], axis=1)
    names = [name.removesuffix("_set") for name in inputs.names]
    if not all(name.lstrip("qd").isdigit() for name in names):
        raise UsageError(
            f"path: moves tell the motion of joints, and this model also takes "
            f"{', '.join(n for n in names if not n.lstrip('qd').isdigit())}: give a file"
        )
    columns = [("q", "qd", "qdd").index(name.rstrip("0123456789")) * chain.n
               + int(name.lstrip("qd")) - 1 for name in names]  # fmt: skip
    return Future(np.ascontiguousarray(u[:, columns]), np.full(len(u), 1.0 / path.rate))
