"""A speed is in no other unit while the recorded position goes as far as it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.fold import make_block
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.units.kinematic import apart, contradicted
from evertwin.setup.setup import Setup
from planted.twins import shipped
from planted.worlds import record_live

TWIN = """
schema = 1
name = "axis"
[clock]
rate = "50 Hz"
[model]
kind = "drive_force"
options = { law = "sign+position" }
[[source]]
name = "log"
time = { column = "t", unit = "s" }
channels.speed = { column = "v", unit = "m/s" }
channels.acceleration = { column = "a", unit = "m/s**2" }
channels.force = { column = "f", unit = "N" }
channels.position = { column = "q", unit = "m" }
"""
STEP, MILES = 0.02, 0.44704


@pytest.fixture
def setup(tmp_path: Path) -> Setup:
    (tmp_path / "axis.toml").write_text(TWIN)
    with Twin.open(tmp_path / "axis.toml") as twin:
        return twin.setup


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("wrong", "scaled"), [(1.0, True), (MILES, False)])
def test_the_position_decides(setup: Setup, seed: int, wrong: float, scaled: bool) -> None:
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(1500)
    w = rng.uniform(0.5, 2.0, (3, 1))
    v = (rng.uniform(0.1, 0.5, (3, 1)) * np.sin(w * t)).sum(axis=0)
    q = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * STEP)])
    named = {"speed": v * wrong, "acceleration": np.gradient(v, STEP), "position": q}
    u = np.stack([named[name] for name in setup.model.inputs.names], axis=1)
    u += rng.normal(0.0, 1e-3, u.shape)
    rows = make_block(t=(t * 1e9).astype(np.int64), u=u, y=np.zeros((len(t), 1)))
    factors = np.ones(3)
    factors[setup.model.inputs.index("speed")] = 1.0 / MILES
    assert contradicted(setup, (rows,), (200, 1500), factors) == scaled
    assert not contradicted(setup, (rows,), (200, 1500), np.ones(3))


LIVE = """
beat = "2 s"
[prediction]
horizon = "1 s"
[anomaly]
requirement = 0.05
window = "10 s"
[tuning]
window = "60 s"
"""


@pytest.mark.parametrize(("gauge", "friction"), [(1.2, 1.0), (0.85, 1.0), (1.0, 1.3)])
def test_a_speed_that_leaves_its_position_is_no_change_of_the_machine(
    tmp_path: Path, gauge: float, friction: float
) -> None:
    rng, n = np.random.default_rng(0), 6000
    t, late = STEP * np.arange(n), np.arange(n) >= n // 2
    v = sum(a * np.sin(w * t) for a, w in ((0.3, 1.1), (0.2, 1.9), (0.25, 0.7)))
    q = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * STEP)])
    seen = v * np.where(late, gauge, 1.0)
    force = 20.0 * np.gradient(v, STEP) + (16.0 * np.sign(v) + 50.0 * v) * np.where(
        late, friction, 1.0
    )
    columns = t, seen, np.gradient(seen, STEP), force + rng.normal(0.0, 0.3, n), q
    np.savetxt(tmp_path / "a.csv", np.column_stack(columns), header="t,v,a,f,q",
               delimiter=",", comments="", fmt="%.6f")  # fmt: skip
    values = "[model.parameters]\nmass = 20.0\nFc = 16.0\nFv = 50.0\n[[source]]"
    text = TWIN.replace("[[source]]", values).replace("[clock]", LIVE + "[clock]")
    beat = 'beat = "2 s"\n'
    text = text.replace(beat, "").replace('name = "axis"', f'name = "axis"\n{beat}')
    (tmp_path / "axis.toml").write_text(text)
    with Twin.open(tmp_path / "axis.toml") as twin:
        events = twin.run([tmp_path / "a.csv"]).events
    told = [e for e in events if e.kind == "abnormal" and e.signal == "speed"]
    if friction != 1.0:
        assert not told
        return
    assert told, [(e.row, e.kind, e.reason) for e in events]
    assert told[0].evidence["number"] == pytest.approx(gauge, rel=0.01)
    assert "promoted" not in {e.kind for e in events}


@pytest.mark.parametrize(("seed", "moves"), [(1, False), (2, False), (3, False), (1, True)])
def test_the_noise_of_what_stands_is_no_reading(setup: Setup, seed: int, moves: bool) -> None:
    """What stands in all the newest rows has no speed there; half of one that moves is told."""
    rng, n = np.random.default_rng(seed), 6000
    v = 0.3 * np.sin(1.1 * STEP * np.arange(n)) * moves
    q, half = np.cumsum(v) * STEP, np.where(np.arange(n) < n // 2, 1.0, 0.5 * moves)
    u = np.zeros((n, len(setup.model.inputs)))
    names = setup.model.inputs.names
    u[:, names.index("position")] = np.round((q + rng.normal(0.0, 2e-5, n)) / 5e-5) * 5e-5
    u[:, names.index("speed")] = half * (v + rng.normal(0.0, 1e-3, n))
    t = np.arange(n) * round(STEP * 1e9)
    rows = Rows.__new__(Rows)
    values = {"setup": setup, "windows": (make_block(t=t, u=u, y=np.zeros((n, 1))),),
              "earlier": (), "since": n // 2, "row": int}  # fmt: skip
    for name, value in values.items():
        object.__setattr__(rows, name, value)
    assert (apart(rows) is not None) == moves


def test_a_first_sample_of_zeros_is_no_other_speed(tmp_path: Path) -> None:
    """A controller shows them before it has a sample: from there to the first one no speed led, so
    a speed was 'otherwise' once friction grew, and nothing was learned."""
    record_live("arm", tmp_path / "arm.csv", 240.0, "150:friction.2=1.3")
    head, first, *rest = (tmp_path / "arm.csv").read_text().splitlines()
    values = first.split(",")
    none = ",".join([values[0], *"0" * (len(values) - 1)])
    (tmp_path / "zeros.csv").write_text("\n".join([head, none, *rest]))
    with Twin(shipped("arm_live")) as twin:
        result = twin.run([tmp_path / "zeros.csv"])
    # On the first beat an axis that moved one way only may be its torque sensor's offset.
    assert {e.signal for e in result.events if e.kind == "abnormal"} <= {"tau2"}
    told = [e.reason for e in result.events if e.kind == "promoted"]
    assert any("Fc2 14 → 18" in reason for reason in told), told
