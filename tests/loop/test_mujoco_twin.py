"""A MuJoCo model in a twin file: fitted, followed, promoted and corrected like any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.models import check_model
from evertwin.models.corrected.corrected import Corrected, Term
from evertwin.models.mujoco import MuJoCo

XML = """<mujoco><option timestep="0.002"/><worldbody><body name="rod">
  <joint name="pivot" axis="0 1 0" damping="{damping}"/>
  <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.5" mass="{mass}"/></body></worldbody>
  <actuator><motor name="motor" joint="pivot"/></actuator></mujoco>"""
TWIN = """schema = 1
name = "pendulum"
beat = 100
[model]
kind = "mujoco"
[model.options]
file = "pendulum.xml"
parameters = ["joint.*.damping", "body.rod.mass"]
[model.parameters]
"body.rod.mass" = { value = 1, low = 0.1, high = 5, source = "data sheet" }
[[source]]
name = "controller"
time = { column = "t", unit = "s" }
[source.channels]
motor = { column = "torque", unit = "Nm" }
"pivot.pos" = { column = "angle", unit = "deg" }
"pivot.vel" = { column = "speed", unit = "rad/s" }
[prediction]
horizon = "1 s"
[anomaly]
requirement = 0.03
window = 300
[tuning]
window = 400
"""


def recorded(rows: int = 1200, seed: int = 0) -> dict[str, np.ndarray]:
    """A machine whose damping and mass the file does not know, at 100 Hz."""
    known = XML.format(damping=0.09, mass=1.0)
    machine = MuJoCo.from_text(known, parameters=["body.rod.mass"])
    rng, k = np.random.default_rng(seed), np.arange(rows)
    u = 2.0 * np.sin(0.021 * k) + np.sin(0.057 * k + seed)
    p = np.array([1.3])
    _, y = machine.simulate(np.zeros(2), u[:-1, None], np.full(rows - 1, 0.01), p)
    y = np.concatenate([np.zeros((1, 2)), y]) + rng.normal(size=(rows, 2)) * [1e-3, 1e-2]
    return {"t": 0.01 * k, "torque": u, "angle": np.rad2deg(y[:, 0]), "speed": y[:, 1]}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "pendulum.xml").write_text(XML.format(damping=0.05, mass=1.0))
    (tmp_path / "pendulum.toml").write_text(TWIN)
    for seed in range(2):
        table = recorded(seed=seed)
        lines = [",".join(table), *(",".join(map(repr, map(float, row)))
                                    for row in zip(*table.values(), strict=True))]  # fmt: skip
        (tmp_path / f"{seed}.csv").write_text("\n".join(lines) + "\n")
    return tmp_path


@pytest.mark.slow
def test_a_fit_finds_what_the_machine_has(folder: Path) -> None:
    with Twin.open(folder / "pendulum.toml") as twin:
        found = twin.fit([folder / "0.csv"], [str(folder / "1.csv")])
    for name, truth in (("joint.pivot.damping", 0.09), ("body.rod.mass", 1.3)):
        k = found.fit.names.index(name)
        assert found.fit.values[k] == pytest.approx(truth, rel=0.02)
        assert found.fit.sigma[k] < 0.02 * truth
    assert all(output.relative_rms < 0.02 for output in found.test)


@pytest.mark.slow
def test_the_loop_tunes_it_and_tries_it_in_shadow(folder: Path) -> None:
    with Twin.open(folder / "pendulum.toml") as twin:
        result = twin.run([folder / "0.csv"])
        assert result.of_kind("tuned") and not result.of_kind("abnormal")
        assert twin.parameters_of(1)["body.rod.mass"].value == pytest.approx(1.3, rel=0.02)
        before, after = twin.compare(0, 1, [folder / "1.csv"]).deviations
        assert after[0].relative_rms < 0.1 * before[0].relative_rms
        twin.promote(1)
        assert twin.validate([str(folder / "1.csv")]).passed


def test_a_wrapper_of_it_is_a_model() -> None:
    model = MuJoCo.from_text(XML.format(damping=0.05, mass=1.0))
    rows, dt = np.random.default_rng(0).normal(size=(20, 1)), np.full(20, 0.01)
    check_model(Corrected(model, (Term("law", "motor", variant="dead zone"),)), rows, dt)


def test_a_table_and_a_coupling_come_from_a_twin_file(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text("""schema = 1
name = "arm"
[model]
kind = "arm"
[model.options]
law = "tanh"
coupling = [[1, 0], [-1, 1]]
motion = "motor"
[[model.options.dh]]
a = "50 cm"
mass = "2 kg"
com = [-0.25, 0, 0]
inertia = [0.002, 0.05, 0.05]
[[model.options.dh]]
a = 0.4
alpha = "90 deg"
mass = 1
com = [-0.2, 0, 0]
inertia = [0.001, 0.02, 0.02]
[[source]]
name = "controller"
time = { column = "t", unit = "s" }
[source.channels]
q1 = { column = "q1", unit = "rad" }
""")
    with Twin.open(tmp_path / "arm.toml") as twin:
        found = twin.validate()
        assert twin.model.outputs.names == ("tau1", "tau2")
    assert found.verification.passed, str(found)
