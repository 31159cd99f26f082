"""The tool's path error: small with stiff controllers, larger with friction and low gains."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.config.scenario import SCENARIO
from evertwin.errors import UsageError
from evertwin.twin.ahead.follow import apart
from evertwin.twin.ahead.whatif import WhatIf


def lines(friction: float = 6.0, law: str = "tanh", g: float = -9.81) -> list[dict[str, Any]]:
    arm = {"name": "arm", "kind": "arm", "urdf": "ur5_like", "gravity": [0.0, 0.0, g]}
    parts: list[dict[str, Any]] = [arm]
    for j in range(1, 7):
        parts += [
            {"name": f"motor{j}", "kind": "motor", "axis": j, "J": 1e-4},
            {"name": f"gearbox{j}", "kind": "gearbox", "axis": j, "ratio": 100,
             "Fc": friction, "Fv": 5.0, "friction": law},
        ]  # fmt: skip
    return parts


def whatif(parts: list[dict[str, Any]], kp: float | None, kv: float = 0.5) -> WhatIf:
    """Half a radian at most, from rest to rest."""
    twin = Twin(TwinSpec("arm", spec.ModelSpec("assembly", {"components": parts})))
    start = np.array([0.0, -1.2, 1.6, -0.4, 0.3, 0.0])
    rng, n = np.random.default_rng(0), 80
    data = {"t": np.arange(n) * 0.05}
    for j in range(6):
        data |= {f"q{j + 1}": np.full(n, start[j]), f"qd{j + 1}": np.zeros(n)}
        data |= {f"qdd{j + 1}": np.zeros(n), f"tau{j + 1}": rng.normal(0.0, 0.1, n)}
    control = "" if kp is None else ", ".join(
        f'{{ name = "control{j}", kind = "controller", axis = {j}, kp = {kp}, kv = {kv}, '
        "feedforward = 1 }" for j in range(1, 7)
    )  # fmt: skip
    told = (
        'schema = 1\nname = "line"\n[path]\nmoves = [{ move = "joints", to = '
        "[0.3, -1.1, 1.5, -0.4, 0.3, 0.2] }]\n"
        f"components = [{control}]\n"
    )
    return twin.whatif(SCENARIO.parse(told, "s.toml"), data)


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


def test_what_lacks_is_said() -> None:
    assert "no controller on axis 1, 2, 3, 4, 5, 6" in whatif(lines(), None).notes[0]
    assert "no controller" in str(whatif(lines(), None))
    with pytest.raises(UsageError, match=r"path error.*tanh"):
        whatif(lines(law="sign"), 20.0)


def test_distances_are_from_the_pieces_of_the_path() -> None:
    corner = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1, 0]])
    assert apart(np.array([[0.5, 0.1, 0], [1.2, 0.5, 0]]), corner) == pytest.approx([0.1, 0.2])
