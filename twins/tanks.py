"""Two cascaded tanks, the upper one without a sensor; what it spills runs partly into the lower."""

from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout

FULL = 10.0


def step(x, u, dt, p):
    """Torricelli's law twice, in four steps a row."""
    upper, level = x
    for _ in range(4):
        out = p[0] * max(upper, 0.0) ** 0.5
        upper += dt / 4 * (p[3] * u[0] - out)
        spilled, upper = max(upper - FULL, 0.0), min(upper, FULL)
        level += dt / 4 * (p[1] * out - p[2] * max(level, 0.0) ** 0.5) + p[4] * spilled
        level = min(max(level, 0.0), FULL)
    return [upper, level], [level]


model = FunctionModel(
    step, Layout.of(pump="V"), Layout.of(level="V"), Layout.of(upper="V", level="V"),
    Parameters.of(
        upper_outlet=(0.05, "V^0.5/s"), share=(1.0, "1"), outlet=(0.05, "V^0.5/s"),
        inflow=(0.05, "1/s"), caught=(0.5, "1"),
    ),
)  # fmt: skip
