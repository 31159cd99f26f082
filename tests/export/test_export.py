"""Out and in again: JSON, MAT and URDF say what the version says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from evertwin.config.spec import ModelSpec, PredictionSpec, StoreSpec, TwinSpec
from evertwin.errors import DataError, ModelError, UsageError
from evertwin.export.formats import identifier
from evertwin.export.urdf import roll_pitch_yaw
from evertwin.machines.arm import Arm
from evertwin.machines.arm.urdf import rotation
from evertwin.sources import inspect
from evertwin.store import Batch, Estimate
from evertwin.twin import Twin

ARM = TwinSpec("arm", ModelSpec("arm", {"urdf": "ur5_like", "law": "tanh"}))
BASED = TwinSpec("arm", ModelSpec("arm", {"urdf": "ur5_like", "base": True, "payload": True}))
ROBOT = TwinSpec("robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0))


def drive() -> dict[str, Any]:
    t = np.arange(100) * 0.1
    v = np.sin(t)
    return {"t": t, "v": v, "x": np.concatenate([[0.0], np.cumsum(0.1 * 0.9 * v[1:])])}


def tuned(spec: TwinSpec, values: dict[str, float]) -> Twin:
    """A twin whose second version has these values, with an interval for each."""
    twin = Twin(spec)
    version = twin._versions.add(twin.champion.form, values, parent=0, reason="tuned")
    twin._ledger.say()
    known = [Estimate(7, 0, 1, name, v, v - 1.0, v + 1.0) for name, v in values.items()]
    twin.store.commit(Batch(known))
    twin.promote(version.number)
    return twin


def test_json_says_values_intervals_and_form(tmp_path: Path) -> None:
    tuned(ARM, {"Fc1": 12.0}).export(tmp_path / "a.json", "json")
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["schema"] == "evertwin.model/1"
    assert found["version"]["number"] == 1 and len(found["version"]["hash"]) == 64
    fc = found["parameters"]["Fc1"]
    assert (fc["value"], fc["interval95"], fc["unit"]) == (12.0, [11.0, 13.0], "Nm")
    assert fc["as_configured"] == 0.0 and fc["verdict"] == "identifiable"
    assert found["parameters"]["Fv1"]["interval95"] is None
    assert [c["name"] for c in found["outputs"]] == [f"tau{k}" for k in range(1, 7)]


@pytest.mark.parametrize("form", ["json", "mat"])
def test_what_goes_out_comes_in_again(tmp_path: Path, form: str) -> None:
    values = {"Fc1": 12.25, "Fv3": 7.5, "Ia6": 0.3}
    file = tmp_path / f"arm.{form}"
    tuned(ARM, values).export(file, form)
    other = Twin(ARM)
    version = other.load(file)
    assert dict(zip(version.names, version.values, strict=True)) == (
        dict(zip(other.champion.names, other.champion.values, strict=True)) | values
    )
    assert other.champion.number == 0 and version.parent == 0
    assert other.promote(version.number).kind == "promoted"


def test_values_of_another_tool_come_in(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "m.mat", {"parameters": {"Fc1": 3.0, "Fv2": {"value": 4.0}}})
    (tmp_path / "j.json").write_text('{"parameters": {"Fc1": 3, "Fv2": {"value": 4.0}}}')
    for name in ("m.mat", "j.json"):
        version = Twin(ARM).load(tmp_path / name)
        known = dict(zip(version.names, version.values, strict=True))
        assert (known["Fc1"], known["Fv2"]) == (3.0, 4.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"parameters": {"Fc9": 1}}', "no parameter 'Fc9'"),
        ('{"parameters": {"Fc1": "x"}}', "expected a number, got str"),
        ('{"parameters": {"Fc1": NaN}}', "finite number"),
        ('{"parameters": {}}', "expected parameters, got none"),
        ("{", "expected JSON"),
        ("nothing", "MAT file of version 5"),
    ],
)
def test_what_cannot_come_in_is_named(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "x.json").write_text(text)
    twin = Twin(ARM)
    with pytest.raises(DataError, match=says):
        twin.load(tmp_path / "x.json")
    assert len(twin.versions) == 1


def test_json_of_another_encoding_comes_in(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text('{"parameters": {"Fc1": 3.5}}', encoding="utf-16")
    version = Twin(ARM).load(tmp_path / "x.json")
    assert dict(zip(version.names, version.values, strict=True))["Fc1"] == 3.5


def test_trajectories_go_out_and_are_a_recording(tmp_path: Path) -> None:
    twin = Twin(ROBOT)
    written = twin.export(tmp_path / "r.mat", "mat", data=drive())
    assert written.rows == 100
    found = scipy.io.loadmat(tmp_path / "r.mat")
    np.testing.assert_allclose(found["x"][:, 0], drive()["x"])
    known = np.isfinite(found["x_predicted"][:, 0])
    assert known.sum() > 90
    assert np.abs(found["x_predicted"] - found["x"])[known].max() < 0.2
    again = {name: found[name][:, 0] for name in ("t", "v", "x")}
    assert Twin(ROBOT).run(again).samples == 100
    columns = {c.name for c in inspect(tmp_path / "r.mat").tables[0].columns}
    assert {"t", "v", "x", "x_predicted"} <= columns


def torques(arm: Arm, p: np.ndarray, u: np.ndarray) -> np.ndarray:
    return arm.simulate(np.zeros(0), u, np.full(len(u), 0.1), p)[1]


def moving(n: int = 50) -> np.ndarray:
    return np.random.default_rng(0).uniform(-2, 2, (n, 18))


def test_a_urdf_is_the_same_machine(tmp_path: Path) -> None:
    """Tuned inertias and a payload, read by our reader and by Pinocchio."""
    pinocchio = pytest.importorskip("pinocchio")
    start = Twin(BASED)
    heavier = {
        n: 1.02 * v for n, v in zip(start.champion.names, start.champion.values) if n[-1] != "I"
    }
    heavier |= {"payload.m": 2.0, "payload.mz": 0.1, "payload.Ixx": 0.02, "payload.Iyy": 0.02,
                "payload.Izz": 0.01}  # fmt: skip
    twin = tuned(BASED, heavier)
    twin.export(tmp_path / "arm.urdf", "urdf")
    tuned_arm = twin.setup.model
    assert isinstance(tuned_arm, Arm)
    u = moving()
    p = twin.champion.p
    for k, name in enumerate(twin.champion.names):
        p[k] = p[k] if "." in name else 0.0  # rigid bodies alone
    expected = torques(tuned_arm, p, u)
    again = Arm.of(str(tmp_path / "arm.urdf"), rotor=False)
    found = torques(again, np.zeros(len(again.parameters)), u)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    model = pinocchio.buildModelFromUrdf(str(tmp_path / "arm.urdf"))
    data = model.createData()
    rigid = np.array([pinocchio.rnea(model, data, r[:6], r[6:12], r[12:]) for r in u])
    np.testing.assert_allclose(rigid, expected, rtol=1e-8, atol=1e-8)


def test_a_urdf_keeps_friction_and_every_parameter(tmp_path: Path) -> None:
    tuned(ARM, {"Fc2": 11.0, "Fv2": 9.0, "Ia2": 1.5}).export(tmp_path / "arm.urdf", "urdf")
    text = (tmp_path / "arm.urdf").read_text()
    assert 'damping="9.0" friction="11.0"' in text
    assert '<parameter name="Ia2" value="1.5"' in text


def test_a_urdf_keeps_the_limits_of_its_joints(tmp_path: Path) -> None:
    twin = tuned(BASED, {})
    model = twin.setup.model
    assert isinstance(model, Arm) and max(model.chain.efforts) > 0.0
    twin.export(tmp_path / "arm.urdf", "urdf")
    again = Arm.of(str(tmp_path / "arm.urdf")).chain
    assert again.efforts == model.chain.efforts and again.limits == model.chain.limits


def test_what_no_body_can_be_is_refused(tmp_path: Path) -> None:
    name = next(n for n in Twin(BASED).champion.names if n.endswith(".Izz"))
    with pytest.raises(ModelError, match="base parameters are combinations"):
        tuned(BASED, {name: -5.0}).export(tmp_path / "arm.urdf", "urdf")
    assert not (tmp_path / "arm.urdf").exists()


def test_a_robot_that_is_no_arm_has_no_urdf(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected a model of kind 'arm'"):
        Twin(ROBOT).export(tmp_path / "r.urdf", "urdf")
    with pytest.raises(UsageError, match="no format 'xls': there are"):
        Twin(ROBOT).export(tmp_path / "r.xls", "xls")


@pytest.mark.parametrize("angles", [(0.1, -0.7, 2.0), (0.3, np.pi / 2, 0.2), (1.0, -np.pi / 2, 0)])
def test_angles_give_the_rotation_back(angles: tuple[float, float, float]) -> None:
    turn = rotation(*angles)
    np.testing.assert_allclose(rotation(*roll_pitch_yaw(turn)), turn, atol=1e-12)


def test_names_that_matlab_cannot_have_are_changed_and_kept(tmp_path: Path) -> None:
    assert identifier("law.v#2.gain") == "law__v_2__gain"
    tuned(BASED, {"payload.m": 2.0}).export(tmp_path / "a.mat", "mat")
    found = scipy.io.loadmat(tmp_path / "a.mat", simplify_cells=True)["parameters"]
    assert found["payload__m"]["name"] == "payload.m"
    assert found["payload__m"]["low95"] == 1.0


def test_the_store_keeps_what_was_loaded(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text('{"parameters": {"gain": 0.9}}')
    spec = TwinSpec("r", ModelSpec("robot1d"), store=StoreSpec("r.db"), folder=str(tmp_path))
    with Twin(spec) as twin:
        twin.load(tmp_path / "x.json")
    with Twin(spec) as twin:
        assert [v.reason for v in twin.versions][1] == "loaded from x.json"
