"""An arm with friction of many causes, in other formulas than the library's, in Pinocchio.

Each joint follows sums of sines. What is planted on a joint is drawn by its name; the torque is
that of the description, the rotor and the friction, with noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.resources import files

import numpy as np
import pinocchio as pin

Column = np.ndarray
Extra = Callable[[Column, Column, Column, float], Column]
"""(q, qd, load, size of the joint's dry friction) → torque."""
COULOMB = (12.0, 14.0, 10.0, 3.0, 3.0, 2.5)
VISCOUS = (10.0, 10.0, 8.0, 2.0, 2.0, 2.0)
NOISE = (0.5, 0.8, 0.5, 0.08, 0.08, 0.06)
RATE = 50.0


def sticking(q: Column, v: Column, load: Column, size: float) -> Column:
    """Half as much again at rest, gone at 0.3 rad/s, as 1 / (1 + (v / 0.15)²)."""
    return 0.5 * size * np.sign(v) / (1.0 + (v / 0.15) ** 2)


def carrying(q: Column, v: Column, load: Column, size: float) -> Column:
    """A gear whose losses grow with what it transmits."""
    return 0.15 * np.abs(load) * np.sign(v)


def eccentric(q: Column, v: Column, load: Column, size: float) -> Column:
    """A gear that is 0.3 of its friction tighter at one side."""
    return 0.3 * size * np.cos(q - 0.7) * np.sign(v)


def one_way(q: Column, v: Column, load: Column, size: float) -> Column:
    """Oil that resists backward motion a third more."""
    return np.where(v < 0.0, 0.35 * v * size, 0.0)


def film(q: Column, v: Column, load: Column, size: float) -> Column:
    """A film that thins: 1.2 times the friction, by the speed to the power of 0.45."""
    return 1.2 * size * np.sign(v) * np.abs(v) ** 0.45


def pulling(q: Column, v: Column, load: Column, size: float) -> Column:
    """A spring along the joint."""
    return 0.8 * size * (q - 0.3)


def hanging(q: Column, v: Column, load: Column, size: float) -> Column:
    """A cable's weight that turns with the joint."""
    return 0.9 * size * np.sin(q + 0.4)


def strange(q: Column, v: Column, load: Column, size: float) -> Column:
    """Nothing that a drive is known for: the product of neighbours' squares in time."""
    return 0.8 * size * np.sin(9.0 * v) * np.cos(7.0 * q)


CAUSES: Mapping[str, Extra] = {
    "stribeck": sticking, "load": carrying, "position": eccentric, "direction": one_way,
    "root": film, "spring": pulling, "balance": hanging,
}  # fmt: skip
"""What is planted, by the library's name of its cause."""


def recording(seed: int, seconds: float, planted: Mapping[int, Extra]) -> dict[str, Column]:
    """Columns of one exciting run: t, q, qd, qdd and tau of six joints."""
    rng = np.random.default_rng(seed)
    text = files("evertwin.machines").joinpath("data", "ur5_like.urdf").read_text(encoding="utf-8")
    model = pin.buildModelFromXML(text)
    data, t = model.createData(), np.arange(0.0, seconds, 1.0 / RATE)
    q, v, a = (np.zeros((len(t), 6)) for _ in range(3))
    for j in range(6):
        for k in range(1, 6):
            w = 2.0 * np.pi * (k * 0.07 + rng.uniform(0.0, 0.02))
            size, phase = rng.uniform(0.2, 0.6), rng.uniform(0.0, 2.0 * np.pi)
            q[:, j] += size * np.sin(w * t + phase)
            v[:, j] += size * w * np.cos(w * t + phase)
            a[:, j] -= size * w**2 * np.sin(w * t + phase)
    rigid = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    tau = rigid + a * np.array([1.5, 1.5, 1.2, 0.3, 0.3, 0.3]) + v * np.array(VISCOUS)
    tau += np.tanh(v / 0.02) * np.array(COULOMB) + rng.normal(size=tau.shape) * np.array(NOISE)
    tau[:, 2] += 1.5
    for j, extra in planted.items():
        tau[:, j] += extra(q[:, j], v[:, j], rigid[:, j], COULOMB[j])
    columns = {"t": t}
    for name, rows in (("q", q), ("qd", v), ("qdd", a), ("tau", tau)):
        columns |= {f"{name}{j + 1}": rows[:, j] for j in range(6)}
    return columns
