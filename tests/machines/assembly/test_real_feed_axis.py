"""A feed axis from components on the real axis: the same free run as its one equation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from evertwin.machines.assembly import assembly
from evertwin.machines.drive import Drive

pytestmark = pytest.mark.data
PUBLISHED = {"mass": 95.11, "Fv": 203.5, "Fc": 20.39, "offset": -3.16}


def test_the_published_free_run_is_the_drives(data_dir: Path) -> None:
    """Open loop over the whole record: 5.7 mm with the published values."""
    raw = loadmat(data_dir / "emps" / "DATA_EMPS.mat")
    t, seen, command = (raw[name].ravel() for name in ("t", "qm", "vir"))
    speed = np.polynomial.Polynomial.fit(t[:50], seen[:50], 3).deriv()(t[0])
    start, dt = np.array([seen[0], speed]), np.full(len(t), 1e-3)
    drive = Drive("sign")
    p = drive.parameters.with_values(PUBLISHED).values
    _, expected = drive.simulate(start, 35.15 * command[:, None], dt, p)
    lines = [
        {"name": "motor", "kind": "motor", "axis": 1, "k": 35.15 * 0.01 / (2 * np.pi)},
        {"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.01, "friction": "none"},
        {"name": "guide", "kind": "guide", "axis": 1, "friction": "sign", "Fv": 203.5,
         "Fc": 20.39, "offset": -3.16},
        {"name": "table", "kind": "mass", "axis": 1, "mass": 95.11},
    ]  # fmt: skip
    model = assembly(lines, "forward")
    _, y = model.simulate(start, command[:, None], dt, model.parameters.values)
    assert y == pytest.approx(expected, abs=1e-9)
    rms = 1e3 * float(np.sqrt(np.mean((y[:, 0] - seen) ** 2)))
    assert rms == pytest.approx(5.7, abs=0.2)
