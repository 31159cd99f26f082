"""Where the kernels of an assembly find everything: integers in a context, reals behind addresses.

>>> HEAD, AXIS, RUB
(20, 28, 9)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.machines.arm import layout
from evertwin.machines.arm.lanes import batch
from evertwin.machines.assembly.train import Axis, Rub, Train
from evertwin.machines.friction.kernel import columns_of, record_of
from evertwin.types import Int64

(N, ARM, GEOMETRY, INERTIAS, MAP, REALS, CHOSEN, PAYLOAD, NF, NB, NY, NX, SHARED, DRY,
 PATH, PATH_ROWS, PATH_X, OVERRIDE, BOXED, END) = range(20)  # fmt: skip
HEAD = 20
"""Single integers; then n axes of `AXIS`, nf frictions of `RUB`, the chosen pairs, the codes, the
friction laws' records up to ``END``."""
(MASS, CARRIED, RATIO, SCREW, ROTOR, K, R, L, STIFF, DAMP, KP, KV, KI, FEED, TOP, LIMIT, JOINT,
 MODE, U_Q, U_V, U_A, U_C, X_Q, X_V, X_QM, X_VM, X_I, X_L) = range(28)  # fmt: skip
AXIS = 28
"""Integers of an axis: places in ``p``, switches, columns of ``u``, places in ``x``."""
FORCE, TORQUE, CURRENT, VOLTAGE = range(4)
"""What a command is: effort at the joint, motor torque, motor current, motor voltage."""
LAW, OWN, INSIDE, SHARES, T_U, T_X, CAPACITY, CONDUCTANCE, AMBIENT = range(9)
RUB = 9
"""Integers of a friction: where its law's record begins, axis, side, does it read the load,
temperature, heat balance."""
STEP_MAX, PATH_RATE = range(2)
AGILITY = 2
"""Reals: largest step, rate of the path, agility of each axis, standstill of each friction."""


class Signals(NamedTuple):
    """What a reading takes in and keeps, by name, what it shows, and how it steps.

    >>> Signals(("qd1", "qdd1")).motion is None
    True
    """

    inputs: tuple[str, ...]
    states: tuple[str, ...] = ()
    codes: tuple[int, ...] = ()
    """Which quantity each output is."""
    step: float = np.inf
    motion: np.ndarray | None = None
    """Rows of planned positions and speeds, (rows, 2 n), and their rate."""
    rate: float = 1.0


def place(names: Sequence[str], *wanted: str) -> int:
    """Where the first of some names stands; −1 where none does."""
    return next((names.index(name) for name in wanted if name in names), -1)


def friction_columns(train: Train, rub: Rub) -> Int64[np.ndarray, "k 4"]:
    """A friction law's coefficients (`evertwin.machines.friction.kernel`)."""
    return columns_of(rub.law, _first_friction(train, rub))


def _first_friction(train: Train, rub: Rub) -> int:
    return train.parameters.names.index(f"{rub.name}.{rub.law.parameters()[0].name}")


def _mode(axis: Axis) -> int:
    if axis.motor is None:
        return FORCE
    return {"torque": TORQUE, "current": CURRENT, "voltage": VOLTAGE}[axis.motor.drive]


def _axis(train: Train, axis: Axis, signals: Signals) -> list[int]:
    at, gear, motor, control = train.at, axis.gearbox, axis.motor, axis.controller
    j, screw, inertia = axis.number + 1, at(gear, "lead"), "mass" if axis.slides else "inertia"
    joint = control is not None and str(control.option("feedback")) == "joint"
    own = [f"{name}{j}" for name in ("q", "qd", "qm", "qmd")]
    own += ["" if control is None else f"{control.name}.integral"]
    own += ["" if motor is None else f"{motor.name}.current"]
    return [
        at(axis.structure, inertia), at(axis.payload, inertia),
        screw if screw >= 0 else at(gear, "ratio"), int(screw >= 0),
        *(at(motor, name) for name in ("J", "k", "R", "L")),
        *(at(gear, name) for name in ("stiffness", "damping")),
        *(at(control, name) for name in ("kp", "kv", "ki", "feedforward", "speed_limit", "limit")),
        int(joint), _mode(axis),
        *(place(signals.inputs, f"{name}{j}", f"{name}{j}_set") for name in ("q", "qd", "qdd")),
        place(signals.inputs, *(f"{name}{j}" for name in ("tau", "m", "i", "U"))),
        *(place(signals.states, name) for name in own),
    ]  # fmt: skip


def _rub(train: Train, rub: Rub, law: int, signals: Signals) -> list[int]:
    part = next(part for part in train.components if part.name == rub.name)
    heat = [train.at(part, name) for name in ("capacity", "conductance", "ambient")]
    warmth = [place(names, f"{rub.name}.T") for names in (signals.inputs, signals.states)]
    return [law, rub.axis, int(rub.inside), int("load" in rub.law.reads), *warmth, *heat]


def _agility(train: Train) -> list[float]:
    """The largest acceleration that a unit effort gives each axis of an arm, over its postures."""
    if train.chain is None:
        return [0.0] * len(train.axes)
    n, rng = train.chain.n, np.random.default_rng(0)
    still = train.chain.geometry.copy()
    still[:3] = 0.0
    most = np.zeros(n)
    for _ in range(40):
        rows = np.zeros((n, 3 * n))
        rows[:, :n] = rng.uniform(-np.pi, np.pi, n)
        rows[:, 2 * n :] = np.eye(n)
        mass = batch(still, train.chain.inertia, rows)
        most = np.maximum(most, np.diag(np.linalg.inv(mass)))
    return [float(value) for value in most]


def context_of(
    train: Train, signals: Signals
) -> tuple[Int64[np.ndarray, " k"], tuple[object, ...]]:
    """The kernels' integers, and the arrays that their addresses lead to."""
    chain, n = train.chain, len(train.axes)
    empty, nx = np.zeros(1), len(signals.states)
    geometry = empty if chain is None else chain.geometry.copy()
    inertias = empty if chain is None else chain.inertia.copy()
    carried = empty if chain is None else np.ascontiguousarray(layout.payload_map(chain).ravel())
    reals = np.array(
        [signals.step, signals.rate, *_agility(train), *(rub.law.standstill for rub in train.rubs)]
    )
    motion = empty if signals.motion is None else np.ascontiguousarray(signals.motion)
    payload = train.at(train.load, "m")
    # the load that friction takes its share of is the described one: it must not depend on p
    shared = int(not train.base and payload < 0)
    dry = int(any(rub.law.switch == "sign" for rub in train.rubs))
    laws = [record_of(rub.law, _first_friction(train, rub)) for rub in train.rubs]
    at = HEAD + AXIS * n + RUB * len(laws) + 2 * len(train.base) + len(signals.codes)
    head = [
        n, int(chain is not None), geometry.ctypes.data, inertias.ctypes.data,
        carried.ctypes.data, reals.ctypes.data, len(train.base), payload, len(train.rubs),
        len(train.boxes), len(signals.codes), nx, shared, dry, motion.ctypes.data,
        0 if signals.motion is None else len(motion), place(signals.states, "path.time"),
        place(signals.inputs, "override"), nx - sum(len(box.model.states) for box in train.boxes),
        at + sum(len(law) for law in laws),
    ]  # fmt: skip
    body = [number for axis in train.axes for number in _axis(train, axis, signals)]
    for rub, law in zip(train.rubs, laws, strict=True):
        body += _rub(train, rub, at, signals)
        at += len(law)
    for k, flat in enumerate(train.base):
        body += [flat, train.first_body + k]
    numbers = np.array([*head, *body, *signals.codes], dtype=np.int64)
    numbers = np.concatenate([numbers, *laws])
    return numbers, (geometry, inertias, carried, reals, motion)
