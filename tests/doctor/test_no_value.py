"""Numbers that a recording writes where it has no value, and numbers that only look so."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import write_starter
from evertwin.machines.mobile import Differential
from evertwin.sources import inspect
from evertwin.sources.columns.no_value import no_value
from planted.draws import first_of

ROWS, STEP = 2000, 0.05


def recorded(folder: Path, seed: int, code: float | None, every: int = 2) -> Path:
    """A base whose pose comes every second row, with outages; ``code`` where there is none."""
    rng = np.random.default_rng(seed)
    u = np.column_stack([
        np.repeat(rng.uniform(0.1, 0.8, ROWS // 50), 50),
        np.repeat(rng.uniform(-0.6, 0.6, ROWS // 40), 40),
    ])  # fmt: skip
    base = Differential()
    p = base.parameters.values
    _, pose = base.simulate(np.array([3.0, -2.0, 0.4]), u, np.full(ROWS, STEP), p)
    pose += rng.normal(0.0, [0.004, 0.004, 0.005], (ROWS, 3))
    pose[:, 2] = (pose[:, 2] + np.pi) % (2 * np.pi) - np.pi
    pose[:, :2] *= 1000.0
    gone = np.arange(ROWS) % every > 0
    for at in rng.integers(0, ROWS - 60, 4):
        gone[at : at + 40] = True
    lines = []
    for k, (told, place) in enumerate(zip(np.roll(u, -1, axis=0), pose)):
        said = (
            ("" if code is None else f"{code:g}",) * 3 if gone[k] else [f"{x:.3f}" for x in place]
        )
        lines.append(",".join([f"{STEP * k:.2f}", *(f"{x:.3f}" for x in told), *said]))
    file = folder / "base.csv"
    heads = "t [s],cmd_v [m/s],cmd_w [rad/s],x [mm],y [mm],yaw [rad]"
    file.write_text("\n".join([heads, *lines]) + "\n")
    return file


@first_of("seed", [1, 2, 3])
@pytest.mark.parametrize("code", [0.0, -9999.0, 65535.0])
def test_what_stands_for_no_value_is_named_with_what_to_write(
    code: float, seed: int, tmp_path: Path
) -> None:
    file = recorded(tmp_path, seed, code)
    (table,) = inspect(file).tables
    found = {c.name: c.recurring for c in table.columns if c.recurring is not None}
    assert {name: one[0] for name, one in found.items()} == {"x": code, "y": code, "yaw": code}
    said = "\n".join(inspect(file).findings)
    assert f"x: {code:g} in 5" in said and f"write sentinels = [{code:g}]" in said
    twin = tmp_path / "base.toml"
    write_starter([file], twin, ("", None), True, False)
    with Twin.open(twin) as one:
        told = one.doctor().of_kind("sentinel")
    assert [f.subject for f in told] == ["x", "y", "heading"]
    assert f"x = {{ …, sentinels = [{code:g}] }}" in told[0].step
    text = re.sub(r'(unit = "(?:mm|rad)") \}', rf"\1, sentinels = [{code:g}] }}", twin.read_text())
    twin.write_text(text)
    with Twin.open(twin) as one:
        assert not one.doctor().of_kind("sentinel")


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("every", [1, 2])
def test_a_recording_with_its_values_has_none(every: int, seed: int, tmp_path: Path) -> None:
    (table,) = inspect(recorded(tmp_path, seed, None, every)).tables
    assert not [c.name for c in table.columns if c.recurring is not None]


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
@pytest.mark.parametrize(
    "kind", ["command", "pulses", "switch", "idle", "encoder", "clipped", "rest", "counter"]
)
def test_what_a_machine_does_in_steps_is_meant(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = np.arange(3000)
    noise = rng.normal(0.0, 1.0, len(k))
    value = {
        "command": np.repeat(np.round(rng.uniform(-1, 1, 300), 3), 10) * (k // 10 % 3 > 0),
        "pulses": np.where(k % 40 < 2, 0.0, np.repeat(np.round(rng.uniform(0.2, 1, 75), 3), 40)),
        "switch": (k // 7 % 2).astype(float),
        "idle": np.where(k // 60 % 2 > 0, 50.0 + noise, 0.0),
        "encoder": np.round(20 * np.sin(0.02 * k) + noise),
        "clipped": np.minimum(np.sin(0.01 * k) + 0.01 * noise, 0.8),
        "rest": np.where(np.sin(0.01 * k) > 0, np.cumsum(np.abs(noise)), 0.0),
        "counter": (k % 50).astype(float),
    }[kind]
    assert no_value(value) is None
