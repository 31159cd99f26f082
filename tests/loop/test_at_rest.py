"""A belt axis at rest: friction's sign goes by the noise of its speed, and its force is no frozen
sensor's."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evertwin import Twin
from planted.draws import first_of

ROWS, STUCK = 7000, slice(5000, 5600)
TWIN = """
schema = 1
name = "belt"
beat = "2 s"
[model]
kind = "drive_force"
options = { law = "sign" }
[model.parameters]
mass = { value = 35 }
Fv = { value = 42 }
Fc = { value = 18 }
offset = { value = 2 }
[[source]]
name = "log"
time = { column = "t", unit = "s" }
[source.channels]
speed = { column = "speed", unit = "mm/s" }
force = { column = "current", unit = "N", scale = 60 }
[[derive]]
name = "acceleration"
op = "derivative"
from = ["speed"]
unit = "m/s**2"
[clock]
rate = "100 Hz"
[filter]
cutoff = "8 Hz"
[anomaly]
requirement = 0.05
window = "10 s"
[moving]
above = 0.01
[moving.channels]
force = "speed"
"""


def told(folder: Path, seed: int, *, stuck: bool) -> list[int]:
    """Rows at which its force is said to be frozen."""
    rng, steps = np.random.default_rng(seed), [np.zeros(1)]
    while sum(map(len, steps)) < ROWS:
        last, goal = steps[-1][-1], rng.uniform(-0.8, 0.8) * (rng.random() > 0.2)
        ramp = np.linspace(last, goal, max(int(abs(goal - last) / 0.015), 1) + 1)[1:]
        steps += [ramp, np.full(int(rng.uniform(50, 150)), goal)]
    v = np.convolve(np.concatenate(steps)[:ROWS], np.ones(9) / 9, "same")
    going = np.where(np.abs(v) < 1e-4, 0.0, np.sign(v))
    force = 35 * np.gradient(v, 0.01) + 42 * v + 18 * going + 2
    current = np.round(force / 60 + rng.normal(0.0, 0.02, ROWS), 3)
    if stuck:
        current[STUCK] = current[STUCK.start]
    speed = np.round(1e3 * v + rng.normal(0.0, 0.5, ROWS), 1)
    (folder / "belt.toml").write_text(TWIN)
    table = np.column_stack([0.01 * np.arange(ROWS), speed, current])
    np.savetxt(folder / "log.csv", table, "%.6g", ",", header="t,speed,current", comments="")
    with Twin.open(folder / "belt.toml") as twin:
        events = twin.run(folder / "log.csv").of_kind("measurement_error")
    return [e.row for e in events if e.evidence.get("cause") == "frozen"]


@first_of("seed", [1, 2, 3])
def test_a_force_at_rest_is_not_frozen(tmp_path: Path, seed: int) -> None:
    assert not told(tmp_path, seed, stuck=False)
    found = told(tmp_path, seed, stuck=True)
    assert found and all(STUCK.start <= row < STUCK.stop + 50 for row in found)
