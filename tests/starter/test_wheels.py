"""Two wheels that turn, and a pose: a differential base by its wheels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter

N, DT = 600, 0.05


def _driven(seed: int) -> dict[str, np.ndarray]:
    r = np.random.default_rng(seed)
    left, right = (np.repeat(r.uniform(1.0, 6.0, N // 30), 30) for _ in range(2))
    heading = np.cumsum(DT * 0.1 * (right - left) / 0.4)
    way = DT * 0.05 * (left + right)
    return {
        "left": left, "right": right, "x": np.cumsum(way * np.cos(heading)),
        "y": np.cumsum(way * np.sin(heading)), "heading": heading,
        "voltage": 24.8 - 0.001 * np.arange(N), "current": 1.0 + 0.2 * left,
    }  # fmt: skip


@pytest.mark.parametrize("model", ["", "differential"])
@pytest.mark.parametrize(
    ("names", "per"),
    [
        (
            "/joint_states/wheel_left_joint/velocity /joint_states/wheel_right_joint/velocity "
            "/mocap/base/pose/position/x /mocap/base/pose/position/y /mocap/base/pose/yaw "
            "/battery_state/voltage /battery_state/current", 1.0,
        ),
        ("Rad_links_rpm Rad_rechts_rpm x y yaw Spannung_V Motorstrom_links_A", 60 / (2 * np.pi)),
    ],
)  # fmt: skip
def test_a_battery_drives_no_base(names: str, per: float, model: str, tmp_path: Path) -> None:
    told = _driven(3)
    told["left"], told["right"] = told["left"] * per, told["right"] * per
    file, out = tmp_path / "log.csv", tmp_path / "log.toml"
    head = ",".join(["__time", *names.split()])
    table = np.column_stack([1.7e9 + DT * np.arange(N), *told.values()])
    np.savetxt(file, table, delimiter=",", header=head, comments="", fmt="%.9f")
    write_starter([file], out, (model, None), False, True)
    text, wheels = out.read_text(), names.split()[:2]
    assert 'kind = "differential"' in text
    assert 'options = { wheels = true, wheel_radius = "?", wheel_base = "?" }' in text
    for channel, column in zip(("left", "right"), wheels, strict=True):
        unit = "rpm" if "rpm" in column else "rad/s"
        assert f'{channel} = {{ column = "{column}", unit = "{unit}" }}' in text
    assert "oltage" not in text
