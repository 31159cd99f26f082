"""The same mass as an FMU written in Python (PythonFMU, FMI 2 co-simulation)."""

from __future__ import annotations

from pathlib import Path

from pythonfmu.builder import FmuBuilder

SLAVE = """
import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Mass(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.force, self.x, self.v = 0.0, 0.0, 0.0
        self.mass, self.fc, self.fv = 2.0, 1.5, 0.5
        self.register_variable(Real("force", causality=Fmi2Causality.input))
        for name in ("x", "v"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        for name in ("mass", "fc", "fv"):
            self.register_variable(Real(
                name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))

    def slope(self, v):
        return (self.force - self.fc * math.tanh(v / 0.01) - self.fv * v) / self.mass

    def do_step(self, current_time, step_size):
        v, h = self.v, step_size
        b = self.slope(v)
        d = self.slope(v + 0.5 * h * b)
        f = self.slope(v + 0.5 * h * d)
        k = self.slope(v + h * f)
        speeds = v + 2.0 * ((v + 0.5 * h * b) + (v + 0.5 * h * d)) + (v + h * f)
        self.x += h / 6.0 * speeds
        self.v += h / 6.0 * (b + 2.0 * (d + f) + k)
        return True
"""


def build(folder: Path) -> Path:
    """The FMU file."""
    folder.mkdir(parents=True, exist_ok=True)
    script = folder / "mass_slave.py"
    script.write_text(SLAVE)
    return Path(FmuBuilder.build_FMU(script, dest=folder))
