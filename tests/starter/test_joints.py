"""Arms that nobody describes: as many joints as the headings say, and the bodies are asked."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.errors import ConfigError


def _written(path: Path, count: int, heads: list[str], sign: str, extra: str) -> Path:
    r = np.random.default_rng(count)
    t = 0.012 * np.arange(600)
    columns = [t]
    for k in range(len(heads) * count):
        columns.append(30.0 * np.sin(r.uniform(0.5, 3.0) * t + k) + r.normal(0.0, 0.01, len(t)))
    names = [head.format(i=i) for head in heads for i in range(count)]
    table = np.column_stack([*columns, np.full(len(t), 100.0)])
    head = sign.join(["time [s]", *names, extra])
    np.savetxt(path, table, delimiter=sign, header=head, comments="", fmt="%.6g", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("count", "heads", "sign"),
    [
        (5, ["AxisAct_A{i} [°]", "CurrAct_A{i} [%]"], ";"),
        (6, [f"{q}_{{i}}" for q in ("target_q", "actual_q", "actual_qd", "actual_current")], " "),
        (7, ["Gelenk{i} Winkel [deg]", "Gelenk{i} Drehmoment [Nm]"], "\t"),
        (4, ["J{i}_pos [rad]", "J{i}_vel [rad/s]", "J{i}_effort"], ","),
    ],
)  # fmt: skip
def test_joints_without_a_description(
    count: int, heads: list[str], sign: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = _written(tmp_path / "log.csv", count, heads, sign, "OV_PRO")
    out = tmp_path / "log.toml"
    if sign == " ":
        file.write_text(file.read_text(encoding="utf-8").replace("time [s]", "timestamp", 1))
    write_starter([file], out, ("", None), False, False)
    text, said = out.read_text(), capsys.readouterr().out
    assert 'kind = "arm"' in text
    assert 'urdf = "?"' in text
    assert len(re.findall(r"^q\d+ = [{]", text, re.M)) == count
    assert len(re.findall(r"^tau\d+ = [{]", text, re.M)) == count
    assert "target" not in text
    assert f"its {count} joints are found, its bodies have to be described" in said
    assert "--urdf" in said
    with pytest.raises(ConfigError, match="a question that was left open"):
        read(out)


@pytest.mark.parametrize(
    ("count", "heads"),
    [
        (3, ["pos{i} [deg]", "cur{i} [A]"]),
        (5, ["x{i} [mm]", "force{i} [N]"]),
        (6, ["target_q_{i}", "target_current_{i}"]),
        (6, ["temp{i} [degC]", "current{i} [A]"]),
    ],
)
def test_what_is_no_arm(count: int, heads: list[str], tmp_path: Path) -> None:
    file = _written(tmp_path / "log.csv", count, heads, ",", "n")
    write_starter([file], tmp_path / "log.toml", ("", None), False, True)
    written = sorted(tmp_path.glob("*.toml"))
    assert written
    assert all('kind = "arm"' not in one.read_text() for one in written)


@pytest.mark.parametrize(("speed", "above"), [(0.8, 0.05), (0.03, 0.006)])
def test_an_arm_moves_above_a_part_of_what_its_slowest_joint_goes(
    speed: float, above: float, tmp_path: Path
) -> None:
    t = 0.05 * np.arange(3000)
    head, columns = ["t [s]"], [t]
    for j in range(6):
        rate = (0.3 + 0.1 * j) * np.ones(3000)
        qd = speed * (1.0 + 0.3 * j) * np.sign(np.sin(rate * t))
        head += [f"J{j + 1}_pos_rad", f"J{j + 1}_vel_rad/s", f"J{j + 1}_torque_Nm"]
        columns += [np.cumsum(qd) * 0.05, qd, 5.0 * np.sign(qd)]
    file = tmp_path / "arm.csv"
    rows = np.column_stack(columns)
    np.savetxt(file, rows, fmt="%.6f", delimiter=",", header=",".join(head), comments="")
    write_starter([file], file.with_suffix(".toml"), ("arm", None), True, False)
    text = file.with_suffix(".toml").read_text()
    assert f"above = {above:g}" in text
    assert "width" not in text  # the rows tell it
