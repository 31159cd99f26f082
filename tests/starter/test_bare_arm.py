"""An arm's file without headings, or with a heading line that repeats, becomes its channels."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.types import Float64
from planted.draws import first_of

DT = 0.01


def motion(seed: int, joints: int) -> Float64[np.ndarray, "rows columns"]:
    """Stamps, angles, speeds and torques of so many joints [s, rad, rad/s, Nm], with noise."""
    rng, t = np.random.default_rng(seed), DT * np.arange(2000)
    waves = [rng.uniform((0.1, 0.05, 0.0), (0.6, 0.5, 6.0), (3, 3)) for _ in range(joints)]
    q = np.array([sum(a * np.sin(6.28 * f * t + p) for a, f, p in one) for one in waves]).T
    qd = np.gradient(q, DT, axis=0)
    tau = rng.uniform(0.1, 3.0, joints) * np.gradient(qd, DT, axis=0) + 2.0 * np.sign(qd)
    tau += 10.0 * np.cos(np.cumsum(q, axis=1))
    sizes = np.repeat([0.0, 1e-5, 0.003, 0.1], [1, joints, joints, joints])
    return np.column_stack([t, q, qd, tau]) + rng.normal(0.0, 1.0, (2000, 3 * joints + 1)) * sizes


def columns(file: Path, kind: str = "", urdf: Path | None = None) -> dict[str, str | int]:
    out = file.with_suffix(".toml")
    write_starter([file], out, (kind, urdf), True, False)
    text = out.read_text().replace('urdf = "?"', 'urdf = "ur5_like"')
    out.write_text(text.replace('scale = "?"', "scale = 1.0"))
    return {name: c.column for one in read(out).source for name, c in one.channels.items()}


@first_of(("seed", "joints"), [(1, 6), (2, 4), (3, 7), (4, 5), (5, 6)])
def test_blocks_without_headings_are_told_by_what_they_change_by(
    tmp_path: Path, seed: int, joints: int
) -> None:
    file, rows = tmp_path / "run.csv", motion(seed, joints)
    np.savetxt(file, rows, fmt="%.6f", delimiter=",")
    found = columns(file)
    want = [f"{name}{j + 1}" for name in ("q", "qd", "tau") for j in range(joints)]
    assert found == {name: 1 + k for k, name in enumerate(want)}


@first_of("seed", range(4))
def test_blocks_of_another_machine_are_no_arm(tmp_path: Path, seed: int) -> None:
    """Twelve temperatures, and noise."""
    rng, file = np.random.default_rng(seed), tmp_path / "run.csv"
    rows = 300.0 + np.cumsum(rng.normal(0.0, 0.1, (1000, 12)), axis=0)
    np.savetxt(file, np.column_stack([np.arange(1000), rows]), fmt="%.5f", delimiter=",")
    write_starter([file], file.with_suffix(".toml"), ("", None), True, False)
    assert 'kind = "python"' in file.with_suffix(".toml").read_text()


def test_a_heading_that_repeats_is_told_apart_by_the_line_below(tmp_path: Path) -> None:
    file, rows = tmp_path / "run.csv", motion(7, 6)
    what = ["Position", "Geschwindigkeit", "Moment"]
    names = ["t", *(name for name in what for _ in range(6))]
    lines = [names, ["", *[f"J{j}" for j in range(1, 7)] * 3], ["s", *np.repeat(
        ["rad", "rad/s", "Nm"], 6
    )]]  # fmt: skip
    head = "\n".join(",".join(line) for line in lines)
    np.savetxt(file, rows, fmt="%.6f", delimiter=",", header=head, comments="")
    found = columns(file)
    assert len(found) == 18
    assert (found["q1"], found["qd6"]) == ("Position J1", "Geschwindigkeit J6")


def test_one_joint_that_moves_tells_the_six_of_a_real_arm(
    tmp_path: Path, data_set: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A description alone says that it is an arm; a desired torque is no acceleration."""
    folder, file = data_set("ur10e"), tmp_path / "run.csv"
    text = (folder / "jointwise" / "ur-20_01_22-joint_1.csv").read_text()
    file.write_text("\n".join(text.splitlines()[:3000]))
    found = columns(file, urdf=folder / "ur10e.urdf")
    assert found == {
        f"{name}{j}": first + j
        for name, first in (("q", 0), ("qd", 6), ("tau", 12))
        for j in range(1, 7)
    }


def test_a_described_arm_is_proposed_what_tells_its_wear(tmp_path: Path) -> None:
    file, out = tmp_path / "run.csv", tmp_path / "run.toml"
    np.savetxt(file, motion(1, 6), fmt="%.6f", delimiter=",")
    with as_file(files("evertwin.machines").joinpath("data", "ur5_like.urdf")) as urdf:
        write_starter([file], out, ("arm", urdf), True, False)
    text = out.read_text().replace('scale = "?"', "scale = 1.0")
    out.write_text(text)
    head, _, block = text.partition("ask evertwin life:\n")
    assert not read(out).indicator
    block = re.sub(r"limit = \S.*#", "limit = 20  #", re.sub("^# ", "", block, flags=re.M))
    out.write_text(head + "\n" + block)
    rules = read(out).indicator
    assert [one.component for one in rules] == [f"joint{j}" for j in range(1, 7)]
    assert all(re.fullmatch(rf"Fc{j} \+ [0-9.]+ \* Fv{j}", str(one.formula))
               for j, one in enumerate(rules, start=1))  # fmt: skip


@first_of("seed", [1, 2, 3])
def test_counts_of_encoders_are_asked_about(tmp_path: Path, seed: int) -> None:
    file, rows, joints = tmp_path / "run.csv", motion(seed, 6), 6
    rows[:, 0] *= 1e3
    rows[:, 1 : 1 + 2 * joints] = np.round(rows[:, 1 : 1 + 2 * joints] * 16384.0)
    names = ["ms", *(f"{n}{j + 1}{u}" for n, u in (("enc", ""), ("vel", ""), ("cur", "_mA"))
                     for j in range(joints))]  # fmt: skip
    np.savetxt(file, rows, fmt="%.3f", delimiter=",", header=",".join(names), comments="")
    out = file.with_suffix(".toml")
    write_starter([file], out, ("arm", Path("ur5_like")), True, False)
    said = re.findall(r'^(qd?)\d = \{ column = "(enc|vel)\d".* scale = "\?"', out.read_text(), re.M)
    assert said == [("q", "enc")] * joints + [("qd", "vel")] * joints
