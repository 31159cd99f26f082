"""The tool's path error: small with stiff controllers, larger with friction and low gains."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.changes import changed
from evertwin.ahead.path_error import apart, followed
from evertwin.ahead.spec import SCENARIO, ScenarioSpec
from evertwin.ahead.whatif import WhatIf, today
from evertwin.config import spec
from evertwin.errors import ConfigError, UsageError

LOAD = '[load]\nmass = "3 kg"'


def lines(
    friction: float = 6.0, law: str = "tanh", g: float = -9.81, **arm: Any
) -> list[dict[str, Any]]:
    arm = {"name": "arm", "kind": "arm", "urdf": "ur5_like", "gravity": [0.0, 0.0, g], **arm}
    parts: list[dict[str, Any]] = [arm]
    for j in range(1, 7):
        parts += [
            {"name": f"motor{j}", "kind": "motor", "axis": j, "J": 1e-4},
            {"name": f"gearbox{j}", "kind": "gearbox", "axis": j, "ratio": 100,
             "Fc": friction, "Fv": 5.0, "friction": law},
        ]  # fmt: skip
    return parts


START = (0.0, -1.2, 1.6, -0.4, 0.3, 0.0)
MOVES = '{ move = "joints", to = [0.3, -1.1, 1.5, -0.4, 0.3, 0.2] }'


def recording(outputs: str = "tau") -> dict[str, np.ndarray]:
    """Standing where the path starts."""
    rng, n = np.random.default_rng(0), 80
    data = {"t": np.arange(n) * 0.05}
    for j in range(6):
        data |= {f"q{j + 1}": np.full(n, START[j]), f"qd{j + 1}": np.zeros(n)}
        data |= {f"qdd{j + 1}": np.zeros(n), f"{outputs}{j + 1}": rng.normal(0.0, 0.1, n)}
    return data


def told(path: str, more: str = "", moves: str = MOVES) -> ScenarioSpec:
    return SCENARIO.parse(
        f'schema = 1\nname = "line"\n[path]\nmoves = [{moves}]\n{path}\n{more}', "s.toml"
    )


def gains(kp: Any, kv: Any, **more: Any) -> str:
    rest = "".join(f", {key} = {value}" for key, value in more.items())
    return f"controller = {{ kp = {kp}, kv = {kv}, feedforward = 1{rest} }}"


def twin_of(parts: list[dict[str, Any]]) -> Twin:
    return Twin(TwinSpec("arm", spec.ModelSpec("assembly", {"components": parts})))


def whatif(parts: list[dict[str, Any]], kp: float, kv: float = 0.5, more: str = "") -> WhatIf:
    """Half a radian at most, from rest to rest."""
    return twin_of(parts).whatif(told(gains(kp, kv), more), recording())


@pytest.mark.slow
def test_stiff_controllers_follow_and_soft_ones_fall_behind() -> None:
    stiff, soft = (
        whatif(lines(), kp, kv).after.path_error for kp, kv in ((60.0, 20.0), (5.0, 2.0))
    )
    assert stiff["tool"].unit == "mm"
    assert stiff["tool"].largest < 1.0
    assert soft["tool"].largest > 5.0 * stiff["tool"].largest
    for one in (stiff, soft):
        assert one["tool, off the path"].largest <= one["tool"].largest + 1e-9


def test_friction_adds_to_the_path_error() -> None:
    found = [whatif(lines(fc, g=0.0), 20.0, 4.0).after.path_error["tool"].rms for fc in (2, 20)]
    assert found[1] > 1.5 * found[0]


def test_a_stiff_loop_s_error_is_the_torque_over_the_gains() -> None:
    # at rest at the end, P-P control stands off by torque / (ratio * kp * kv) at each joint
    found = {g: whatif(lines(0.0), 20.0, g).after.path_error["tool"].end for g in (4.0, 8.0)}
    assert found[4.0] / found[8.0] == pytest.approx(2.0, rel=0.1)


def test_a_line_for_each_controller_says_the_same() -> None:
    each = ", ".join(
        f'{{ name = "c{j}", kind = "controller", axis = {j}, kp = 20, kv = {4 + j}, '
        "feedforward = 1 }" for j in range(1, 7)
    )  # fmt: skip
    data, twin = recording(), twin_of(lines())
    one = twin.whatif(told(f"components = [{each}]"), data).after.path_error
    short = told(gains(20, [5, 6, 7, 8, 9, 10]))
    assert twin.whatif(short, data).after.path_error["tool"].size.tolist() == (
        one["tool"].size.tolist()
    )
    # a line of its own goes before what is said of all
    both = told(f"{gains(1, 1)}\ncomponents = [{each}]")
    assert twin.whatif(both, data).after.path_error["tool"].rms == one["tool"].rms


@pytest.mark.parametrize("motor", [(), (10.0, 9.0, 8.0, 7.0, 6.0, 5.0)])
def test_an_arm_of_its_own_kind_has_the_same_error(motor: tuple[float, ...]) -> None:
    """Same parameters, same controllers, counted at the joint: ratio 1 in place of 100."""
    options = {"urdf": "ur5_like", "law": "tanh+stribeck+load", "motor": list(motor), "base": True}
    values = {f"Ia{j}": 1.0 for j in range(1, 7)} | {f"Fv{j}": 5.0 for j in range(1, 7)}
    values |= {f"Fc{j}": 6.0 for j in range(1, 7)} | {f"Fl{j}": 0.2 for j in range(1, 7)}
    values |= {"forearm_link.mx": 0.4}
    own = Twin(TwinSpec("arm", spec.ModelSpec("arm", options)))
    names = own.model.parameters.names
    values = {key: value for key, value in values.items() if key in names}
    set_to = {key: spec.ParameterSpec(value=value) for key, value in values.items()}
    own = Twin(TwinSpec("arm", spec.ModelSpec("arm", options, set_to)))
    parts = lines(law="tanh+stribeck+load", base=True)
    inside = {"Ia": "motor{}.J", "Fv": "gearbox{}.Fv", "Fc": "gearbox{}.Fc", "Fl": "gearbox{}.Fl"}
    there = {
        inside[key[:2]].format(key[2:]) if key[:2] in inside else f"arm.{key}": value
        for key, value in values.items()
    }
    there |= {f"motor{j}.J": 1e-4 for j in range(1, 7)}
    set_to = {key: spec.ParameterSpec(value=value) for key, value in there.items()}
    parted = Twin(TwinSpec("a", spec.ModelSpec("assembly", {"components": parts}, set_to)))
    at_joint = [100.0 * 4.0 / k for k in motor] or 400.0
    scale = "i" if motor else "tau"
    one = own.whatif(told(gains(20, at_joint)), recording(scale)).after.path_error["tool"]
    other = parted.whatif(told(gains(20, 4.0)), recording()).after.path_error["tool"]
    assert one.size == pytest.approx(other.size, abs=1e-6)
    assert one.largest > 1.0


def test_the_path_error_grows_where_a_torque_is_at_its_limit() -> None:
    free = whatif(lines(), 20.0, 4.0)
    peak = free.after.outputs["tau2"].peak
    found = [
        whatif(lines(), 20.0, 4.0, f"[limits]\ntau2 = {share * peak}").after for share in (1.5, 0.6)
    ]
    assert found[0].path_error["tool"].rms == pytest.approx(free.after.path_error["tool"].rms)
    assert found[1].path_error["tool"].largest > 3.0 * found[0].path_error["tool"].largest
    # the controller's own limit, at the motor
    own = twin_of(lines()).whatif(told(gains(20.0, 4.0, limit=0.006 * peak)), recording())
    assert own.after.path_error["tool"].largest > found[0].path_error["tool"].largest


def test_what_the_values_leave_open_is_the_interval() -> None:
    twin = twin_of(lines(g=0.0))
    names, size = twin.model.parameters.names, {}
    for fc in (5.0, 6.0, 7.0):
        scenario = told(gains(20, 4), f'[parameters]\n"gearbox*.Fc" = {fc}')
        size[fc] = twin.whatif(scenario, recording()).after.path_error["tool"].rms
    basis = twin.prospect(None, recording()).basis
    case = today(basis, recording()).case
    sigma = np.where([name.endswith(".Fc") for name in names], 0.5, 0.0)
    scenario = told(gains(20, 4))
    after = changed(basis, replace(case, sigma=sigma), scenario)
    assert scenario.path is not None
    found = followed(basis, after, scenario.path, {})[0]["tool"]
    assert found.rms == size[6.0]
    assert found.rms95 is not None
    assert size[5.0] < found.rms95[0] < found.rms < found.rms95[1] < size[7.0]


def test_a_load_at_the_tip_is_carried_along_the_path() -> None:
    bare, loaded = (whatif(lines(0.0), 20.0, 4.0, more).after for more in ("", LOAD))
    share = loaded.path_error["tool"].end / bare.path_error["tool"].end
    torque = loaded.outputs["tau2"].rms / bare.outputs["tau2"].rms
    assert torque > 1.2
    assert share == pytest.approx(torque, rel=0.25)


def test_a_sign_is_read_as_a_tanh_and_that_is_said() -> None:
    found, smooth = whatif(lines(law="sign"), 20.0, 4.0), whatif(lines(), 20.0, 4.0)
    assert "gearbox1, gearbox2" in found.notes[0]
    assert found.after.path_error["tool"].rms == smooth.after.path_error["tool"].rms


def test_what_lacks_is_said() -> None:
    bare = twin_of(lines()).whatif(told(""), recording())
    assert "no controller on axis 1, 2, 3, 4, 5, 6" in bare.notes[0]
    assert "controller = {" in str(bare)
    for wrong, said in (
        (gains("[1, 2]", 1), "expected kp as a number or 6 of them, one for each axis, got 2"),
        ("controller = { kq = 1 }", "kq"),
    ):
        with pytest.raises(UsageError, match=said):
            twin_of(lines()).whatif(told(wrong), recording())
    with pytest.raises(ConfigError, match="controller: expected a table"):
        told("controller = 3")
    wild = whatif(lines(), 20.0, 1e7)
    assert "do not hold the arm" in wild.notes[0]


def test_distances_are_from_the_pieces_of_the_path() -> None:
    corner = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1, 0]])
    assert apart(np.array([[0.5, 0.1, 0], [1.2, 0.5, 0]]), corner) == pytest.approx([0.1, 0.2])


def test_the_distance_from_a_path_is_that_from_its_nearest_piece() -> None:
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.0, 60)[:, None]
    there = np.concatenate([np.sin(7.0 * t), np.cos(5.0 * t), t], axis=1) * 0.4
    path = np.concatenate([there, np.repeat(there[-1:], 50, axis=0), there[::-1]])
    points = path + 0.01 * rng.normal(size=path.shape)
    share = np.linspace(0.0, 1.0, 41)[:, None, None]
    fine = (path[:-1] + share * np.diff(path, axis=0)).reshape(-1, 3)
    every = np.linalg.norm(points[:, None] - fine, axis=2).min(axis=1)
    assert apart(points, path) == pytest.approx(every, abs=7e-4)
