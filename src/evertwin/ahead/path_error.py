"""How far an arm's tool is off a new path: the path given to its controllers as set-points.

The components of the twin, read forward: controller → motor → gearbox → structure, with the live
values. The arm first stands where the path starts, held by its controllers, and then follows. Two
errors are told: how far the tool is from where it should be at that time (``tool``), and how far
from the path itself (``tool, off the path``), which leaves out what is only late.

The components of the twin and what the scenario adds: a line for each, or ``controller`` for all
axes at once. An arm of ``kind = "arm"`` is told by components first: a motor with the rotor's
inertia and a gearbox with the friction at each joint, both counted at the joint (ratio 1), so that
a parameter means the same in both readings.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.ahead.basis import Basis, draws
from evertwin.ahead.changes import Case, chain_of, inner
from evertwin.ahead.simulated import PathError
from evertwin.ahead.spec import PathSpec
from evertwin.errors import UsageError
from evertwin.machines.arm import Arm
from evertwin.machines.arm.chain import Chain
from evertwin.machines.assembly import Forward
from evertwin.machines.assembly.columns import turns
from evertwin.machines.assembly.kinematics import tips
from evertwin.machines.assembly.parts import KINDS
from evertwin.machines.assembly.train import Axis, Train
from evertwin.machines.catalog import located, machine
from evertwin.models import Model
from evertwin.types import Float64, Inputs, Int64, Intervals, ParameterVector, Vector

Line = Mapping[str, Any]
ONE_EACH = ("motor", "gearbox", "controller")
"""Roles that an axis has once."""
GEOMETRY = ("urdf", "dh", "convention", "before", "tool", "tip", "gravity", "base")
"""Options of an arm that its component has too."""


class Controlled(NamedTuple):
    """The forward reading, and where its values come from.

    >>> Controlled._fields
    ('model', 'values', 'place', 'notes')
    """

    model: Forward
    values: ParameterVector
    """Of the forward reading, as its components say."""
    place: Mapping[int, int]
    """Where the twin's values belong: their index, and the index in the forward reading."""
    notes: tuple[str, ...] = ()

    def of(self, p: ParameterVector) -> Float64[np.ndarray, " nf"]:
        """The forward reading's values for values of the twin."""
        found = self.values.copy()
        found[list(self.place.values())] = p[list(self.place)]
        return found


def controlled(
    basis: Basis, case: Case, path: PathSpec, limits: Mapping[str, float]
) -> Controlled | str:
    """The forward reading of a case's arm; else what is missing, in a sentence.

    Args:
        limits: largest size by channel; those of torques and currents hold for the controllers.

    Raises:
        UsageError: components that cannot be joined or have no forward reading.
    """
    said, found = basis.setup.spec.model, inner(case.model)
    names = dict(zip(case.model.parameters.names, case.model.parameters.names, strict=True))
    if isinstance(found, Arm):
        if found.coupling is not None:
            return "path error: not told, coupled motors have no forward reading"
        own, names = components_of(found, said.options), names_of(found)
    elif said.kind == "assembly":
        there: Any = said.options.get("components", ())
        own = list(there)
    else:
        return f"path error: not told, a model of kind {said.kind!r} has no forward reading"
    if "payload.m" in names and not any(line.get("kind") == "payload" for line in own):
        own.append({"name": "payload", "kind": "payload"})
    try:
        added = _added(path, found.chain.n if isinstance(found, Arm) else len(found.train.axes))
        lines, notes = _smooth([*_kept(own, added), *added])
        options: dict[str, Any] = {"reading": "forward", "components": lines}
        if "step" in said.options:
            options["step"] = said.options["step"]
        model: Any = machine("assembly", located(basis.setup.spec.folder, options))
    except UsageError as error:
        raise UsageError(f"path error: {error}") from error
    missing = [str(axis.number + 1) for axis in model.train.axes if axis.controller is None]
    if missing:
        return (
            f"path error: not told, no controller on axis {', '.join(missing)}: say in [path] "
            "controller = { kp = …, kv = …, feedforward = … }, each a number or one for each axis"
        )
    given = {f"{line['name']}.{key}" for line in added for key in line}
    forward = model.parameters.names
    place = {
        k: forward.index(name)
        for k, name in enumerate(names.values())
        if name in forward and name not in given
    }
    whole = Controlled(model, model.parameters.values, place, tuple(notes))
    return whole._replace(values=_limited(model.train, whole.of(case.p), limits))


def components_of(arm: Arm, options: Mapping[str, Any]) -> list[Line]:
    """The components of an arm of ``kind = "arm"``."""
    lines: list[Line] = [
        {"name": "arm", "kind": "arm", **{key: options[key] for key in GEOMETRY if key in options}}
    ]
    for j, law in enumerate(arm.laws, start=1):
        drive = "current" if arm.motor else "torque"
        if arm.rotor or arm.motor:
            lines.append({"name": f"motor{j}", "kind": "motor", "axis": j, "drive": drive})
        lines.append({
            "name": f"gearbox{j}", "kind": "gearbox", "axis": j, "friction": str(law),
            **law.shape,
        })  # fmt: skip
    return lines


def names_of(arm: Arm) -> dict[str, str]:
    """What each parameter of an arm is called among its components.

    >>> names = names_of(Arm.of("ur5_like", motor=[10.0] * 6, payload=True))
    >>> [names[name] for name in ("Ia2", "Fc3", "K1", "payload.m")]
    ['motor2.J', 'gearbox3.Fc', 'motor1.k', 'payload.m']
    """
    own: dict[str, str] = {}
    for j, law in enumerate(arm.laws, start=1):
        inside = (item.name for item in law.parameters())
        own |= {f"Ia{j}": f"motor{j}.J", f"K{j}": f"motor{j}.k"}
        own |= {f"{name}{j}": f"gearbox{j}.{name}" for name in inside}
    return {
        name: own.get(name, name if name.startswith("payload.") else f"arm.{name}")
        for name in arm.parameters.names
    }


def _added(path: PathSpec, n: int) -> list[Line]:
    """What the scenario adds: its lines, and a controller on each axis without one."""
    lines: Any = path.components
    gains = path.controller if isinstance(path.controller, Mapping) else {}
    told = {line.get("axis") for line in lines if line.get("kind") == "controller"}
    found = [*lines]
    for key, value in gains.items():
        if isinstance(value, list | tuple) and len(value) != n:
            raise UsageError(
                f"controller: expected {key} as a number or {n} of them, one for each axis, "
                f"got {len(value)}"
            )
    for j in range(n):
        if gains and j + 1 not in told:
            values = {
                key: value[j] if isinstance(value, list | tuple) else value
                for key, value in gains.items()
            }
            found.append({"name": f"control{j + 1}", "kind": "controller", "axis": j + 1, **values})
    return found


def _kept(own: Iterable[Line], added: Sequence[Line]) -> list[Line]:
    """The twin's lines that the scenario's leave: a planner gives way, and what is replaced."""
    names = {line.get("name") for line in added}
    taken = {(line.get("axis"), _role(line)) for line in added}
    return [
        line
        for line in own
        if _role(line) != "path"
        and line.get("name") not in names
        and not (_role(line) in ONE_EACH and (line.get("axis"), _role(line)) in taken)
    ]


def _role(line: Line) -> str:
    kind = str(line.get("kind"))
    return KINDS[kind].role if kind in KINDS else ""


def _smooth(lines: Iterable[Line]) -> tuple[list[Line], list[str]]:
    """Lines with smooth friction: where a sign lets a joint stand still, ``tanh`` lets it creep."""
    found: list[Line] = []
    changed = []
    for line in lines:
        law = str(line.get("friction", ""))
        if law.split("+")[0] == "sign":
            line = {**line, "friction": law.replace("sign", "tanh", 1)}
            changed.append(str(line.get("name")))
        found.append(line)
    if not changed:
        return found, []
    return found, [f"path error: friction's sign is a tanh here ({', '.join(changed)})"]


def _limited(train: Train, p: ParameterVector, limits: Mapping[str, float]) -> ParameterVector:
    """Controllers that demand no more than limits of torque and current allow."""
    for axis in train.axes:
        at = train.at(axis.controller, "limit")
        p[at] = min(p[at], *(
            _demand(train, axis, p, what) * limits[f"{what}{axis.number + 1}"]
            for what in ("tau", "m", "i") if f"{what}{axis.number + 1}" in limits
        ), math.inf)  # fmt: skip
    return p


def _demand(train: Train, axis: Axis, p: ParameterVector, what: str) -> float:
    """Demand of a controller for one unit of effort (tau), motor torque (m) or current (i)."""
    drive = None if axis.motor is None else axis.motor.drive
    if drive == "voltage":
        return math.inf  # a voltage limits no torque by itself
    ratio = turns(train, axis, p)
    k = 1.0 if drive is None else float(p[train.at(axis.motor, "k")])
    torque = {"tau": 1.0 / ratio, "m": 1.0, "i": k}[what]
    return torque * {None: ratio, "torque": 1.0, "current": 1.0 / k}[drive]


DRAWS = 16
"""Runs beside the one with the values as they are, at most."""
TAIL, TAIL_OF_DRAWS = 1.96, 2.12
"""95 % of a normal distribution; of Student's with `DRAWS` degrees of freedom."""
FINE = 1e-3
"""Longest time from one set-point to the next [s]."""
NEAREST = 8
"""Corners of the path at which the nearest piece of it is looked for."""
SETTLE = 1.0
"""How long the arm stands at the start before it moves [s]."""


class _Run(NamedTuple):
    """What the controllers are told, in rows of `FINE` at most."""

    u: Inputs
    dt: Intervals
    path: Float64[np.ndarray, "rows joints"]
    """Planned joint positions in the rows of the path."""
    rows: Int64[np.ndarray, " rows"]
    """Which of the rows those are; before the first of them the arm settles."""


def followed(
    basis: Basis, case: Case, path: PathSpec, limits: Mapping[str, float]
) -> tuple[Mapping[str, PathError], tuple[str, ...]]:
    """Errors of the tool on a case's path; else what is missing, in a sentence.

    Args:
        limits: largest size by channel; torques and currents are no larger than theirs.

    Raises:
        UsageError: components that cannot be joined or have no forward reading.
    """
    chain = chain_of(case.model)
    if chain is None:
        return {}, ()
    forward = controlled(basis, case, path, limits)
    if isinstance(forward, str):
        return {}, (forward,)
    run = _set_points(case, forward.model, chain.n)
    planned = tips(chain, run.path)
    ps, reach = _around(case)
    gone = np.stack([_tool(forward.model, chain, run, forward.of(p)) for p in ps])
    if not np.isfinite(gone[0]).all():
        return {}, ("path error: the controllers do not hold the arm: change their gains",)
    t = case.future.t
    late = np.linalg.norm(gone - planned, axis=2)
    off = np.stack([apart(one, planned) for one in gone])
    notes = forward.notes
    if basis.version.form.terms:
        notes = (*notes, "path error: without the terms that a correction has added")
    return {
        "tool": _told(late, planned, t, reach), "tool, off the path": _told(off, planned, t, reach)
    }, notes  # fmt: skip


def _around(case: Case) -> tuple[Float64[np.ndarray, "k np"], float]:
    """The values as they are, then others as credible; what their spread is multiplied with.

    Few uncertain values are moved one by one by their standard deviation, and the changes add up
    as squares do; many are drawn together.
    """
    p, sigma = case.p, case.sigma
    open_ = np.flatnonzero(sigma)
    if len(open_) > DRAWS:
        others = draws(case.model, p, sigma, DRAWS, seed=3)
        return np.concatenate([p[None], others]), TAIL_OF_DRAWS / np.sqrt(DRAWS)
    high = case.model.parameters.high
    others = np.tile(p, (len(open_), 1))
    for row, k in zip(others, open_.tolist(), strict=True):
        row[k] += sigma[k] if row[k] + sigma[k] <= high[k] else -sigma[k]
    return np.concatenate([p[None], others]), TAIL


def _set_points(case: Case, model: Model, n: int) -> _Run:
    """Standing at the start, then the path, as inputs of the forward reading."""
    future = case.future
    names = [name.removesuffix("_set") for name in case.model.inputs.names]
    wanted = [name.removesuffix("_set") for name in model.inputs.names]
    unknown = [name for name in wanted if name not in names]
    if unknown:
        raise UsageError(f"path error: the path does not tell {', '.join(unknown)}")
    u = future.u[:, [names.index(name) for name in wanted]]
    step, parts = float(np.median(future.dt)), max(math.ceil(np.median(future.dt) / FINE), 1)
    # between the rows of the path the set-points go on smoothly, as those of a controller do
    course: Any = scipy.interpolate.CubicHermiteSpline(future.t, u[:, :n], u[:, n : 2 * n])
    within = np.repeat(future.dt[1:] / parts, parts)
    ends = future.t[0] + np.cumsum(within)
    moving = np.repeat(u[1:], parts, axis=0)
    # a position is reached at the end of its row, at the speed of the whole row
    moving[:, :n], moving[:, n : 2 * n] = course(ends), course(ends - 0.5 * within, 1)
    still = np.repeat(u[:1], 1 + max(round(SETTLE / step), 1), axis=0)
    still[:, n : 2 * n] = 0.0
    return _Run(
        np.concatenate([still, moving]), np.concatenate([np.full(len(still), step), within]),
        u[:, :n], len(still) - 1 + parts * np.arange(len(u)),
    )  # fmt: skip


def _tool(model: Model, chain: Chain, run: _Run, p: ParameterVector) -> Float64[np.ndarray, "n 3"]:
    """Where the tool is in each row of the path [m]."""
    y0 = np.full(len(model.outputs), np.nan)
    y0[: chain.n], y0[chain.n : 2 * chain.n] = run.path[0], 0.0
    x = model.observe(model.initial(p), y0)
    _, y = model.simulate(x, run.u, run.dt, p)
    return tips(chain, y[run.rows, : chain.n])


def apart(
    points: Float64[np.ndarray, "n 3"], path: Float64[np.ndarray, "m 3"]
) -> Float64[np.ndarray, " n"]:
    """Distance of each point from a path of straight pieces [m].

    >>> line = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    >>> apart(np.array([[1.3, 0.4, 0.3], [3.0, 0.0, 0.0]]), line).round(6).tolist()
    [0.5, 1.0]
    """
    moved = np.any(np.diff(path, axis=0) != 0.0, axis=1)
    path = path[np.concatenate([[True], moved])] if moved.any() else path
    begin, way = path[:-1], np.diff(path, axis=0)
    length = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
    # rests left out, the nearest piece begins or ends at one of the nearest corners
    _, near = scipy.spatial.cKDTree(path).query(points, k=min(NEAREST, len(path)))
    near = near.reshape(len(points), -1)
    pieces = np.clip(np.concatenate([near - 1, near], axis=1), 0, len(way) - 1)
    here = points[:, None, :] - begin[pieces]
    share = np.clip(np.einsum("nij,nij->ni", here, way[pieces]) / length[pieces], 0.0, 1.0)
    gap = here - share[:, :, None] * way[pieces]
    found: Float64[np.ndarray, " n"] = np.sqrt(np.einsum("nij,nij->ni", gap, gap).min(axis=1))
    return found


def _told(
    size: Float64[np.ndarray, "k n"],
    planned: Float64[np.ndarray, "n 3"],
    t: Float64[np.ndarray, " n"],
    reach: float,
) -> PathError:
    """The error in mm; the first run holds the values as they are."""
    size = size * 1e3
    worst = int(np.argmax(size[0]))

    def within(values: Vector) -> tuple[float, float]:
        value = float(values[0])
        # a run that the controllers do not hold leaves the error open
        half = reach * float(np.linalg.norm(np.nan_to_num(values[1:] - value, nan=np.inf)))
        return max(value - half, 0.0), value + half

    rms, top, end = np.sqrt(np.mean(size**2, axis=1)), size.max(axis=1), size[:, -1]
    return PathError(
        "mm", float(rms[0]), float(top[0]), float(end[0]), within(end), within(top), within(rms),
        float(t[worst]), tuple(planned[worst].tolist()), t, size[0],
    )  # fmt: skip
