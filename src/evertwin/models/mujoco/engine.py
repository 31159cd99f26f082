"""One MuJoCo engine: a compiled model with memory of its own, used by one thread at a time.

A row advances the state by its ``dt`` in steps of the model's own time step; where that does not
divide ``dt`` the steps of the row are shortened until it does. The state is what the next row
depends on and nothing else: MuJoCo's warm start is switched off, so rows may be cut anywhere.

A step that diverges (MuJoCo's warnings, a value that is not finite) makes its row NaN and leaves
the state as it was before the row. Warnings are values here, so MuJoCo's own log to the screen and
to a file is switched off for the process.

Todorov, Erez, Tassa, "MuJoCo: A physics engine for model-based control" (2012).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco import _rollout

from evertwin.errors import ModelError
from evertwin.models.mujoco.guard import Source
from evertwin.models.tables.bodies import Part
from evertwin.types import Float64, StateVector

LARGEST_VALUE = 1e10
"""Beyond it MuJoCo calls a value bad."""
MOST_STEPS = 100_000
"""Steps in one row: a longer one (a gap in a recording) is not simulated."""
_CHUNK = 200_000
"""Steps in one call, for its memory."""
_MEMORY = 2_000_000_000
_SPEC = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)
_OFF = int(mujoco.mjtDisableBit.mjDSBL_WARMSTART | mujoco.mjtDisableBit.mjDSBL_AUTORESET)


class Steps(NamedTuple):
    """How a row is cut.

    >>> steps_of(0.005, 0.002)
    Steps(number=3, size=0.0016666666666666668)
    """

    number: int
    size: float


def steps_of(dt: float, step: float) -> Steps:
    """Steps of a row of ``dt`` seconds; none for a row without duration or one too long.

    >>> [steps_of(dt, 0.002).number for dt in (0.01, 0.0, 1e9)]
    [5, 0, -1]
    """
    if dt == 0.0:
        return Steps(0, step)
    ratio = dt / step
    if not 0.0 < ratio <= MOST_STEPS:
        return Steps(-1, step)
    near = round(ratio)
    if near and abs(ratio - near) < 1e-6:
        return Steps(near, dt / near)
    count = max(1, math.ceil(ratio))
    return Steps(count, dt / count)


def compiled(
    source: Source, timestep: float | None = None, contact: bool = True, shifts: bool = False,
    tables: Iterable[tuple[Sequence[float], Iterable[Part]]] = (),
) -> Any:  # fmt: skip
    """The compiled model of a checked source.

    Args:
        source: from `evertwin.models.mujoco.guard`.
        timestep: in place of the model's own [s].
        contact: may bodies touch?
        shifts: may centres of mass be moved later?
        tables: pose [m, m, rad] and pieces of those that stand around it.

    Raises:
        ModelError: MuJoCo refuses it (with its reason), or it holds what is not simulated here.
    """
    quiet = mujoco.MjLogConfig.get()
    quiet.logto_file = quiet.logto_console = False
    quiet.set()
    try:
        spec = mujoco.MjSpec.from_string(source.text, assets=dict(source.assets))
        for pose, pieces in tables:
            _stand(spec.worldbody, pose, pieces)
        model = spec.compile()
        if shifts:
            model = _generic(spec, model)
    except (ValueError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"{source.where}: MuJoCo refuses the model: {reason}") from error
    where = source.where
    full = mujoco.mj_stateSize(model, int(mujoco.mjtState.mjSTATE_FULLPHYSICS))
    if full != 1 + model.nq + model.nv + model.na:
        raise ModelError(f"{where}: delays, plasticity and plugins have a state that is not kept")
    if not 0 < model.nv <= 1000 or model.narena + model.nbuffer > _MEMORY:
        raise ModelError(
            f"{where}: expected 1 to 1000 degrees of freedom in less than 2 GB, got {model.nv} in "
            f"{(model.narena + model.nbuffer) / 1e9:.1f} GB"
        )
    if timestep is not None:
        model.opt.timestep = timestep
    if not 1e-7 <= model.opt.timestep <= 10.0:
        raise ModelError(f"{where}: expected a time step of 1e-7 to 10 s, got {timestep}")
    model.opt.disableflags |= _OFF
    if not contact:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model


def _stand(world: Any, pose: Sequence[float], pieces: Iterable[Part]) -> None:
    """A table that does not move."""
    x, y, turn = (float(one) for one in pose)
    body = world.add_body(pos=[x, y, 0.0], quat=[math.cos(turn / 2), 0, 0, math.sin(turn / 2)])
    for kind, at, size in pieces:
        shape = mujoco.mjtGeom.mjGEOM_BOX if kind == "box" else mujoco.mjtGeom.mjGEOM_CYLINDER
        body.add_geom(type=shape, pos=at, size=[*size, 0.0][:3])


def _generic(spec: Any, model: Any) -> Any:
    """The model without the short cuts that MuJoCo takes for bodies centred on their frame.

    They are chosen when a model is compiled and would be wrong for another centre of mass. So each
    body is compiled a little off its centre, then put back.
    """
    given = [(b.name, model.body(b.name)) for b in spec.bodies[1:] if b.name]
    for name, body in given:
        part = spec.body(name)
        part.explicitinertial, part.mass, part.inertia = True, body.mass[0], body.inertia
        part.iquat, part.ipos = body.iquat, body.ipos + 1e-3
    made = spec.compile()
    for name, body in given:
        made.body(name).ipos[:] = body.ipos
    mujoco.mj_setConst(made, mujoco.MjData(made))
    return made


class Engine:
    """A compiled model and its memory.

    >>> from evertwin.models.mujoco.guard import read_text
    >>> model = compiled(read_text('<mujoco><worldbody><body><joint type="slide" axis="1 0 0"/>'
    ...     '<geom size=".1" mass="1"/></body></worldbody></mujoco>'))
    >>> x, states = Engine(model).run(np.zeros(2), np.ones((1, 1)), Steps(5, 0.002))
    >>> x.round(6).tolist()
    [6e-05, 0.01]
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.rollout = _rollout.Rollout(nthread=0)
        self.written: bytes = b""
        """Parameters that are in the model, as bytes."""

    def run(
        self, x: StateVector, control: Float64[np.ndarray, "n nc"], steps: Steps
    ) -> tuple[StateVector, Float64[np.ndarray, "n nx"]]:
        """Rows of equal duration: (state after the last, state after each); NaN rows diverged."""
        n, now = len(control), x
        out = np.full((n, len(x)), np.nan)
        at, size = 0, max(1, _CHUNK // steps.number)
        while at < n:
            part = min(size, n - at)
            good = self._rows(now, control[at : at + part], steps, out[at : at + part])
            if good:
                now = out[at + good - 1]
            # After a failure one row at a time, then twice as many: else a model that fails in
            # every row would be rolled out to the end from each.
            size = min(2 * size, max(1, _CHUNK // steps.number)) if good == part else 1
            at += good if good == part else good + 1
        return np.array(now), out

    def _rows(self, x: StateVector, control: Any, steps: Steps, out: Any) -> int:
        """Fills the rows before the first that diverges; how many these are."""
        n, count = len(control), steps.number
        first = np.concatenate([np.zeros(1), x])[None]
        fine = control if count == 1 else np.repeat(control, count, axis=0)
        states = np.empty((1, n * count, 1 + len(x)))
        self.model.opt.timestep = steps.size
        sensors = np.empty((1, n * count, self.model.nsensordata))
        self.rollout.rollout(
            [self.model], [self.data], n * count, _SPEC, first, None,
            np.ascontiguousarray(fine)[None], states, sensors, None,
        )  # fmt: skip
        good = self._good(states[0], steps) // count
        out[:good] = states[0, count - 1 :: count, 1:][:good]
        return int(good)

    def _good(self, states: Any, steps: Steps) -> int:
        """Steps before the first bad one. After a warning MuJoCo repeats the last state."""
        good = len(states)
        # A NaN fails both comparisons.
        if not (states.min() > -LARGEST_VALUE and states.max() < LARGEST_VALUE):
            sound = (np.abs(states) < LARGEST_VALUE).all(axis=1)
            good = good if sound.all() else int(np.argmin(sound))
        if np.any(self.data.warning.number):
            still = np.flatnonzero(np.diff(states[:, 0]) <= 0.5 * steps.size)
            good = min(good, int(still[0]) if len(still) else len(states) - 1)
        return good

    def sensors(
        self, states: Float64[np.ndarray, "n nx"], control: Float64[np.ndarray, "n nc"]
    ) -> Float64[np.ndarray, "n ns"]:
        """What the sensors show in each state under its control; NaN where the state is."""
        known = np.isfinite(states).all(axis=1)
        n = int(known.sum())
        out = np.full((len(states), self.model.nsensordata), np.nan)
        if not n:
            return out
        before = np.concatenate([np.zeros((n, 1)), states[known]], axis=1)
        after, seen = np.empty((n, 1, before.shape[1])), np.empty((n, 1, out.shape[1]))
        self.rollout.rollout(
            [self.model] * n, [self.data], 1, _SPEC, before, None,
            np.ascontiguousarray(control[known])[:, None], after, seen, None,
        )  # fmt: skip
        out[known] = np.where(np.abs(seen[:, 0]) < LARGEST_VALUE, seen[:, 0], np.nan)
        return out
