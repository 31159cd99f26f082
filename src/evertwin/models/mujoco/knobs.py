"""What may be tuned of a MuJoCo model, named by path: ``joint.elbow.damping``.

A knob is a place in the compiled model. After writing, MuJoCo derives the rest anew
(``mj_setConst``), so a changed model behaves as one that was compiled with these values.

    joint.NAME     damping, frictionloss, armature, stiffness, springref
    body.NAME      mass, com_x, com_y, com_z, inertia_1, inertia_2, inertia_3 (principal moments)
    actuator.NAME  gain, gear, kp and kv (where the actuator is a servo)
    geom.NAME      friction, torsional, rolling

>>> from evertwin.models.mujoco.engine import compiled
>>> from evertwin.models.mujoco.guard import read_text
>>> model = compiled(read_text('''<mujoco><worldbody><body name="rod"><joint name="pivot"
...   damping="0.3"/><geom size=".1"/></body></worldbody></mujoco>'''))
>>> [(k.name, k.value(model), k.unit) for k in knobs_of(model, ("joint.*.damping",))]
[('joint.pivot.damping', 0.3, 'Nms/rad')]
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import mujoco

from evertwin.errors import UsageError
from evertwin.models.mujoco.engine import compiled
from evertwin.models.mujoco.guard import Source
from evertwin.models.parameters import Parameter, Parameters

DEFAULT = (
    "joint.*.damping", "joint.*.frictionloss", "joint.*.armature", "actuator.*.gain",
    "actuator.*.kp", "actuator.*.kv",
)  # fmt: skip
"""Knobs of a model that asks for no others."""
NEAR = 6
"""Knobs that are named where none is what was asked for."""


class Place(NamedTuple):
    """An entry of one of the compiled model's arrays; ``sign`` −1 where it holds the negative.

    >>> Place("dof_damping", (0,)).sign
    1.0
    """

    array: str
    at: tuple[int, ...]
    sign: float = 1.0


@dataclass(frozen=True)
class Knob:
    """One number, and all places of the compiled model that hold it.

    >>> Knob("joint.j.damping", (Place("dof_damping", (0,)),), "Nms/rad", 0.0).editable
    True
    """

    name: str
    places: tuple[Place, ...]
    unit: str
    low: float = -math.inf
    editable: bool = True

    def value(self, model: Any) -> float:
        """The number in the model."""
        array, at, sign = self.places[0]
        return sign * float(getattr(model, array)[at])

    def write(self, model: Any, value: float) -> None:
        """Puts the number into the model."""
        for array, at, sign in self.places:
            getattr(model, array)[at] = sign * value


def name_of(model: Any, kind: str, number: int) -> str:
    """An element's name; ``joint3`` where it has none."""
    objects = {
        "joint": mujoco.mjtObj.mjOBJ_JOINT, "body": mujoco.mjtObj.mjOBJ_BODY,
        "geom": mujoco.mjtObj.mjOBJ_GEOM, "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
        "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
    }  # fmt: skip
    return mujoco.mj_id2name(model, objects[kind], number) or f"{kind}{number}"


def knobs_of(model: Any, patterns: Sequence[str] = DEFAULT) -> tuple[Knob, ...]:
    """The knobs whose names match a pattern, in the model's order.

    Raises:
        UsageError: a pattern matches none.
    """
    every = tuple(_all(model))
    for pattern in patterns:
        if pattern not in DEFAULT and not any(fnmatchcase(k.name, pattern) for k in every):
            near = get_close_matches(pattern, [k.name for k in every], NEAR, 0.0)
            raise UsageError(
                f"parameters: no parameter matches {pattern!r}; there are {', '.join(near)} …"
            )
    return tuple(k for k in every if any(fnmatchcase(k.name, p) for p in patterns))


def tunable(
    source: Source, patterns: Sequence[str], timestep: float | None = None, contact: bool = True
) -> tuple[Any, tuple[Knob, ...]]:
    """The compiled model of a source and its knobs; compiled for moving centres where one may."""
    model = compiled(source, timestep, contact)
    knobs = knobs_of(model, patterns)
    if any(".com_" in knob.name for knob in knobs):
        model = compiled(source, timestep, contact, shifts=True)
    return model, knobs


def parameters_of(model: Any, knobs: Sequence[Knob], source: str) -> Parameters:
    """The knobs as parameters, starting at the model's values."""
    return Parameters(
        tuple(
            Parameter(k.name, k.value(model), k.unit, k.low, editable=k.editable, source=source)
            for k in knobs
        )
    )


def _all(model: Any) -> Iterator[Knob]:
    for j in range(model.njnt):
        yield from _joint(model, j)
    for b in range(1, model.nbody):
        yield from _body(model, b)
    for a in range(model.nactuator):
        yield from _actuator(model, a)
    for g in range(model.ngeom):
        path = f"geom.{name_of(model, 'geom', g)}"
        for k, (word, unit) in enumerate((("friction", "1"), ("torsional", "m"), ("rolling", "m"))):
            place = Place("geom_friction", (g, k))
            yield Knob(f"{path}.{word}", (place,), unit, 0.0, editable=k == 0)


_DOFS = {0: 6, 1: 3, 2: 1, 3: 1}
"""Degrees of freedom of free, ball, slide and hinge joints."""


def _joint(model: Any, j: int) -> Iterator[Knob]:
    path, kind = f"joint.{name_of(model, 'joint', j)}", int(model.jnt_type[j])
    slides = kind == int(mujoco.mjtJoint.mjJNT_SLIDE)
    dofs = [(int(model.jnt_dofadr[j]) + k,) for k in range(_DOFS[kind])]

    def of(array: str) -> tuple[Place, ...]:
        return tuple(Place(array, dof) for dof in dofs)

    yield Knob(f"{path}.damping", of("dof_damping"), "Ns/m" if slides else "Nms/rad", 0.0)
    yield Knob(f"{path}.frictionloss", of("dof_frictionloss"), "N" if slides else "Nm", 0.0)
    unit = "kg" if slides else "kgm2"
    yield Knob(f"{path}.armature", of("dof_armature"), unit, 0.0, editable=False)
    if len(dofs) > 1:
        return
    stiff, rest = ("N/m", "m") if slides else ("Nm/rad", "rad")
    spring = Place("qpos_spring", (int(model.jnt_qposadr[j]),))
    yield Knob(f"{path}.stiffness", (Place("jnt_stiffness", (j,)),), stiff, 0.0)
    yield Knob(f"{path}.springref", (spring,), rest, editable=False)


def _body(model: Any, b: int) -> Iterator[Knob]:
    path = f"body.{name_of(model, 'body', b)}"
    least = 1e-6 * max(float(model.body_mass[b]), 1e-9)
    yield Knob(f"{path}.mass", (Place("body_mass", (b,)),), "kg", least)
    for k, axis in enumerate("xyz"):
        yield Knob(f"{path}.com_{axis}", (Place("body_ipos", (b, k)),), "m")
    for k in range(3):
        least = 1e-6 * max(float(model.body_inertia[b, k]), 1e-12)
        yield Knob(f"{path}.inertia_{k + 1}", (Place("body_inertia", (b, k)),), "kgm2", least)


def _actuator(model: Any, a: int) -> Iterator[Knob]:
    """A servo's gain stands twice in the model: in its gain and, negative, in its bias."""
    path = f"actuator.{name_of(model, 'actuator', a)}"
    gain, bias = model.actuator_gainprm[a], model.actuator_biasprm[a]
    yield Knob(f"{path}.gear", (Place("actuator_gear", (a, 0)),), "1", editable=False)
    if int(model.actuator_gaintype[a]) != int(mujoco.mjtGain.mjGAIN_FIXED):
        return
    first, back = Place("actuator_gainprm", (a, 0)), "actuator_biasprm"
    affine = int(model.actuator_biastype[a]) == int(mujoco.mjtBias.mjBIAS_AFFINE) and gain[0] > 0
    if affine and bias[1] == -gain[0]:
        yield Knob(f"{path}.kp", (first, Place(back, (a, 1), -1.0)), "1", 0.0)
        yield Knob(f"{path}.kv", (Place(back, (a, 2), -1.0),), "1", 0.0)
    elif affine and bias[2] == -gain[0]:
        yield Knob(f"{path}.kv", (first, Place(back, (a, 2), -1.0)), "1", 0.0)
    else:
        yield Knob(f"{path}.gain", (first,), "1")
