"""The Modelica library against the Python components of the same names, to 1e-6."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.machines.assembly import assembly
from evertwin.models.modelica import Modelica

MOTOR = {"name": "motor1", "kind": "motor", "axis": 1, "drive": "torque", "J": 1e-3}
GEAR = {"name": "gearbox1", "axis": 1, "ratio": 100.0, "Fv": 2.0, "Fc": 6.0}
LOAD = {"name": "load1", "kind": "inertia", "axis": 1, "inertia": 2.0}
MACHINES: dict[str, tuple[list[dict[str, Any]], float]] = {
    "Axis": ([MOTOR, {**GEAR, "kind": "gearbox"}, LOAD], 0.4),
    "StribeckAxis": ([MOTOR, {**GEAR, "kind": "stribeck_gearbox", "Fs": 3.0}, LOAD], 0.4),
    "MotorAxis": (
        [
            {**MOTOR, "drive": "voltage", "k": 0.1, "R": 1.0},
            {**GEAR, "kind": "elastic_gearbox", "stiffness": 1e4, "damping": 1.0},
            LOAD,
        ],
        24.0,
    ),
    "SixJoints": (
        [
            line
            for k, (inertia, fv, fc) in enumerate(
                [(3.0, 9.0, 12.0), (3.0, 9.0, 12.0), (1.5, 5.0, 8.0), (0.4, 2.0, 3.0),
                 (0.3, 2.0, 3.0), (0.1, 1.0, 2.0)], start=1,
            )
            for line in (
                {"name": f"gearbox{k}", "kind": "gearbox", "axis": k, "Fv": fv, "Fc": fc},
                {"name": f"load{k}", "kind": "inertia", "axis": k, "inertia": inertia},
            )
        ],
        30.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_of_the_library_is_the_assembly_of_its_components(name: str) -> None:
    lines, most = MACHINES[name]
    ours, theirs = assembly(lines, "forward", step=5e-5), Modelica(f"Evertwin.{name}")
    n = len(ours.inputs)
    assert len(theirs.inputs) == n
    u, dt = np.random.default_rng(1).uniform(-most, most, (40, n)), np.full(40, 0.02)
    p, q = ours.parameters.values, theirs.parameters.values
    _, y = ours.simulate(ours.initial(p), u, dt, p)
    _, z = theirs.simulate(theirs.initial(q), u, dt, q)
    positions = [ours.outputs.index(f"q{k + 1}") for k in range(n)]
    speeds = [ours.outputs.index(f"qd{k + 1}") for k in range(n)]
    np.testing.assert_allclose(z[:, :n], y[:, positions], atol=1e-6)
    np.testing.assert_allclose(z[:, n : 2 * n], y[:, speeds], atol=1e-6)
    assert np.abs(y).max() > 1e-3
