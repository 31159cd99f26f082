"""A heading sensor that goes off: by how much it is told, and in which unit, though angles wrap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import RunResult, Twin
from planted.draws import first_of

AT, LASTS, OFF = 150.0, 240.0, 0.3
TWIN = """
schema = 1
name = "base"
beat = "2 s"
[model]
kind = "differential"
[[source]]
name = "cmd"
files = ["cmd.csv"]
time = { column = "t", unit = "s" }
channels = { v = { column = "v", unit = "m/s" }, w = { column = "w", unit = "rad/s" } }
[[source]]
name = "pose"
files = ["pose.csv"]
time = { column = "t", unit = "s" }
[source.channels]
x = { column = "x", unit = "m" }
y = { column = "y", unit = "m" }
heading = { column = "heading", unit = "rad" }
[clock]
rate = "9.99 Hz"
[arbiter]
use = "blend"
[prediction]
horizon = "1 s"
[anomaly]
requirement = 0.03
relative = false
outputs = ["x", "y", "heading"]
window = "75 s"
[tuning]
window = "300 s"
"""


def wrap(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def driven(folder: Path, seed: int, fault: str) -> RunResult:
    """Commands ten times a second, poses at other stamps, so that rows lie between two samples."""
    rng, dt = np.random.default_rng(seed), 0.01
    t = np.arange(0.0, LASTS, dt)
    held = np.repeat(np.arange(len(t) // 200 + 1), rng.integers(15, 45, len(t) // 200 + 1) * 10)
    u = np.stack([rng.uniform(lo, 0.6, held[-1] + 1) for lo in (-0.2, -0.6)])[:, held[: len(t)]]
    turned = np.cumsum(u[1]) * dt
    way = np.cumsum(u[0] * dt * np.exp(1j * turned))
    at = np.sort(np.clip(np.arange(0.0, LASTS - 1.0, 0.1) + rng.normal(0.0, 5e-3, 2390), 0, None))
    pose = np.stack([np.interp(at, t, one) for one in (way.real, way.imag, turned)], axis=1)
    pose += rng.normal(0.0, 4e-3, pose.shape)
    pose[:, 2] = wrap(pose[:, 2] + OFF * (fault == "offset") * (at >= AT))
    pose[at >= AT, 2] *= 180.0 / np.pi if fault == "degrees" else 1.0
    (folder / "base.toml").write_text(TWIN)
    tables = {"cmd": ("t,v,w", np.column_stack([t, *u])[::10]),
              "pose": ("t,x,y,heading", np.column_stack([at, pose]))}  # fmt: skip
    for name, (head, table) in tables.items():
        np.savetxt(folder / f"{name}.csv", table, "%.6f", ",", header=head, comments="")
    with Twin.open(folder / "base.toml") as twin:
        return twin.run()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_heading_in_degrees_since_then_is_named_so(tmp_path: Path, seed: int) -> None:
    result = driven(tmp_path, seed, "degrees")
    (told,) = result.of_kind("measurement_error")
    assert told.reason == "off by a factor of 180/π (degrees for radians): heading"
    assert not result.of_kind("promoted", "tuned", "measurement_restored")


@first_of("seed", [1, 2, 3])
def test_an_offset_is_told_as_large_as_it_is(tmp_path: Path, seed: int) -> None:
    """A row lies between the samples before and since: it leaps within two rows."""
    result = driven(tmp_path, seed, "offset")
    told = [e.reason for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert told and "heading looks off by +" in told[0]
    size = float(told[0].split("off by +")[1].split()[0])
    assert size == pytest.approx(np.degrees(OFF), rel=0.1)
