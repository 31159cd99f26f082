"""A twin's version written as an FMU, and read back as one."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.errors import UsageError
from evertwin.export.content import Exported, exported
from evertwin.export.fmu import need_of, reading_options, write_fmu
from evertwin.models import Restart, check_model, roll
from evertwin.models.corrected.corrected import Term, build
from evertwin.models.fmu import fmu
from evertwin.models.form import Form
from evertwin.models.kernels.kernel import ADOPT, ANEW

ROBOT = '[model]\nkind = "robot1d"\n'
TANK = """[model]
kind = "python"
options = { file = "tank.py", name = "model" }
"""
TANK_PY = """
from evertwin import FunctionModel, Layout, Parameters
def step(x, u, dt, p):
    level = max(x[0] + dt * (u[0] - p[1] * max(x[0], 0.0) ** 0.5) / p[0], 0.0)
    return [level], [level]
model = FunctionModel(step, Layout.of(inflow="m^3/s"), Layout.of(level="m"), Layout.of(level="m"),
    Parameters.of(area=(1.0, "m^2"), outflow=(0.01, "m^2.5/s")))
"""


def twin_in(folder: Path, model: str) -> Twin:
    (folder / "tank.py").write_text(TANK_PY)
    (folder / "twin.toml").write_text(f'schema = 1\nname = "my tank"\n{model}')
    return Twin.open(folder / "twin.toml")


def out_of(twin: Twin, number: int) -> Exported:
    return exported(twin.setup, twin._versions, twin.store, number, ())


def test_a_corrected_version_comes_back(tmp_path: Path) -> None:
    """A law on the input and a lag with its memory: 1e-9, position updates included."""
    form = Form((Term("law", "v", variant="dead zone"), Term("lag", "*", levels=(4.0,))))
    values = {"law.v.threshold": 0.05, "law.v.gain": 0.9, "lag.delay": 0.02, "lag.tau": 0.03}
    with twin_in(tmp_path, ROBOT) as twin:
        twin._versions.add(form, values, parent=0, reason="planted")
        out, path = out_of(twin, 1), tmp_path / "robot.fmu"
        write_fmu(out, path)
        reference, p = build(twin.model, form), twin.version(1).p
    model = fmu(**{**reading_options(out, path), "file": str(path)})
    assert model.outputs.units == reference.outputs.units
    q = model.parameters.values
    assert dict(zip(model.parameters.names, q)) == dict(zip(reference.parameters.names, p))
    rng = np.random.default_rng(0)
    u, dt = rng.uniform(-0.2, 0.2, (60, 1)), np.full(60, 0.01)
    code = np.zeros(60, dtype=np.uint8)
    code[[0, 40]], code[20] = ANEW, ADOPT
    y = rng.normal(0, 1, (60, 1))
    x0 = reference.initial(p)
    _, wanted = roll(reference.kernel(), x0, u, dt, p, Restart(y, code, x0))
    _, got = roll(model.kernel(), x0, u, dt, q, Restart(y, code, model.initial(q)))
    assert np.nanmax(np.abs(got - wanted)) < 1e-9
    assert np.array_equal(np.isnan(got), np.isnan(wanted))
    model.close()
    with zipfile.ZipFile(path) as archive:
        assert need_of() in archive.read("modelDescription.xml").decode()


def test_a_model_in_a_python_file_travels_along(tmp_path: Path) -> None:
    with twin_in(tmp_path, TANK) as twin:
        out, path = out_of(twin, 0), tmp_path / "tank.fmu"
        written = twin.export(path, "fmu")
        reference = twin.model
    model = fmu(**{**reading_options(out, path), "file": str(path)})
    assert 'options = { file = "tank.fmu", states = ["state.level"]' in written.note
    assert model.parameters["outflow"].unit == "m^2.5/s"
    u, dt = np.full((30, 1), 0.02), np.ones(30)
    check_model(model, u[:5], dt[:5])
    p = reference.parameters.values
    _, wanted = reference.simulate(np.array([0.3]), u, dt, p)
    _, got = model.simulate(np.array([0.3]), u, dt, p)
    assert np.abs(got - wanted).max() < 1e-9
    saved = fmu(path, memory="saved")
    _, kept = saved.simulate(saved.initial(p), u, dt, p)
    _, wanted = reference.simulate(reference.initial(p), u, dt, p)
    assert np.abs(kept - wanted).max() < 1e-9
    for made in (model, saved):
        made.close()


OUTSIDE = """
import sys
from fmpy import simulate_fmu
for path in sys.argv[1:]:
    row = simulate_fmu(path, stop_time=3.0, output_interval=1.0)
    print(*row["level"])
    print(*simulate_fmu(path, start_values={"state.level": 2.0}, stop_time=1.0)["level"][:1])
"""


def outside(*paths: Path) -> list[list[float]]:
    """What FMPy makes of FMUs, one after the other in one process."""
    done = subprocess.run(
        [sys.executable, "-c", OUTSIDE, *map(str, paths)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return [[float(one) for one in line.split()] for line in done.stdout.splitlines()]


def test_another_tool_begins_where_the_recordings_end(tmp_path: Path) -> None:
    """The first row is the start, and the process takes it again and again."""
    with twin_in(tmp_path, TANK) as twin:
        rows = {"t": [0.0, 1.0, 2.0], "inflow": [0.0, 0.02, 0.02], "level": [0.4, 0.45, 0.5]}
        note = twin.export(tmp_path / "seen.fmu", "fmu", data=rows).note
        _, y = twin.model.simulate(
            np.array([0.5]), np.full((3, 1), 0.02), np.ones(3), twin.champion.p
        )
    assert "starts where the recordings end" in note
    seen, told, again, _ = outside(tmp_path / "seen.fmu", tmp_path / "seen.fmu")
    np.testing.assert_allclose(seen, [0.5, *y[:, 0]], rtol=1e-9)
    assert told == [2.0] and again == seen


def test_what_has_to_be_set_is_said(tmp_path: Path) -> None:
    with twin_in(tmp_path, TANK) as twin:
        note = twin.export(tmp_path / "tank.fmu", "fmu").note
    assert "no recordings say where it starts: set state.level (0), inflow (0)" in note
    with zipfile.ZipFile(tmp_path / "tank.fmu") as archive:
        assert "set state.level (0)" in archive.read("modelDescription.xml").decode()


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    with (
        twin_in(tmp_path, ROBOT) as twin,
        pytest.raises(UsageError, match=r"expected a name that ends with \.fmu"),
    ):
        write_fmu(out_of(twin, 0), tmp_path / "robot.zip")
