"""An arm with its controllers, read forward: set-points in, motion out.

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

from evertwin.ahead.basis import Basis
from evertwin.ahead.changes import Case
from evertwin.ahead.paths import inner
from evertwin.ahead.spec import PathSpec
from evertwin.errors import UsageError
from evertwin.machines.arm import Arm
from evertwin.machines.assembly import Forward
from evertwin.machines.assembly.columns import turns
from evertwin.machines.assembly.parts import KINDS
from evertwin.machines.assembly.train import Axis, Train
from evertwin.machines.catalog import located, machine
from evertwin.types import Float64, ParameterVector

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
    drive = None if axis.motor is None else str(axis.motor.option("drive") or "current")
    if drive == "voltage":
        return math.inf  # a voltage limits no torque by itself
    ratio = turns(train, axis, p)
    k = 1.0 if drive is None else float(p[train.at(axis.motor, "k")])
    torque = {"tau": 1.0 / ratio, "m": 1.0, "i": k}[what]
    return torque * {None: ratio, "torque": 1.0, "current": 1.0 / k}[drive]
