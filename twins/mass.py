"""A mass under a force, with viscous friction and dry friction that is smooth over 1 cm/s."""

import math

from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.signals import Layout


def step(x, u, dt, p):
    """Four steps of an implicit rule."""
    (position, v), (mass, fc, fv) = x, p
    for _ in range(4):
        steep = fc / 0.01 / math.cosh(min(abs(v) / 0.01, 300.0)) ** 2 + fv
        force = u[0] - fc * math.tanh(v / 0.01) - fv * v
        v += dt / 4 * force / (mass + dt / 4 * steep)
        position += dt / 4 * v
    return [position, v], [position, v]


motion = Layout.of(x="m", v="m/s")
model = FunctionModel(
    step, Layout.of(force="N"), motion, motion,
    Parameters((
        Parameter("mass", 2.0, "kg", 0.1, 50.0),
        Parameter("fc", 1.5, "N", 0.0, 50.0),
        Parameter("fv", 0.5, "Ns/m", 0.0, 50.0),
    )),
)  # fmt: skip
