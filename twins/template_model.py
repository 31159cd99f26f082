"""A model of your own in ten lines: a tank with an inflow and an outlet."""

from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout


def step(x, u, dt, p):
    """Next state and outputs from state, input over the interval dt [s] and parameters."""
    level = max(x[0] + dt * (u[0] - p[1] * max(x[0], 0.0) ** 0.5) / p[0], 0.0)
    return [level], [level]


model = FunctionModel(
    step, Layout.of(inflow="m^3/s"), Layout.of(level="m"), Layout.of(level="m"),
    Parameters.of(area=(1.0, "m^2"), outflow=(0.01, "m^2.5/s")),
)  # fmt: skip
