"""What flows in sets the level that a tank, or an oven's temperature, tends to."""

import math

from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.signals import Layout


def step(x, u, dt, p):
    """Exact over an input that is held."""
    k, tau, offset = p
    goal = k * u[0] + offset
    level = goal + math.exp(-dt / tau) * (x[0] - goal)
    return [level], [level]


level = Layout.of(x="1")
model = FunctionModel(
    step, Layout.of(u="1"), level, level,
    Parameters((
        Parameter("k", 1.0, "1"), Parameter("tau", 10.0, "s", 1e-3, 1e6),
        Parameter("offset", 0.0, "1"),
    )),
)  # fmt: skip
