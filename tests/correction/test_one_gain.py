"""A law that a table was refined to is the machine's: one gain, told once, no lag where there is
none, and the threshold from which on it moves."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.models.form import Term
from evertwin.models.terms.registry import kind

SPEC = """
schema = 1
name = "cart"
beat = 50
[model]
kind = "robot1d"
[[source]]
name = "plc"
time = { column = "t", unit = "s" }
channels.v = { column = "v", unit = "m/s" }
channels.x = { column = "x", unit = "m" }
[prediction]
horizon = "1 s"
[anomaly]
requirement = "6 mm"
[correction]
channels = ["v"]
terms = ["lag", "law", "table"]
"""


def driven(
    seed: int, gain: float, zone: float, cap: float, rows: int = 2600
) -> dict[str, np.ndarray]:
    """Ten times a second; of each command the zone is lost, and no more than the cap is left."""
    rng, v, at = np.random.default_rng(seed), np.zeros(rows), 0
    while at < rows:
        hold = int(rng.integers(7, 30))
        v[at : at + hold] = rng.choice([-1, 1]) * rng.uniform(0.02, 0.35) * (rng.random() > 0.12)
        at += hold
    x = np.zeros(rows)
    for k in range(rows - 1):
        v[k] = -v[k] if v[k] * x[k] > 0.0 and abs(x[k]) > 6.0 else v[k]
        x[k + 1] = x[k] + 0.1 * gain * np.sign(v[k]) * np.clip(abs(v[k]) - zone, 0.0, cap)
    return {"t": 0.1 * np.arange(rows), "v": v, "x": x + rng.normal(0.0, 4e-4, rows)}


@pytest.mark.parametrize(("seed", "gain"), [(1, 1.0), (2, 0.8)])
def test_of_a_product_one_number_is_told(seed: int, gain: float, tmp_path: Path) -> None:
    (tmp_path / "cart.toml").write_text(SPEC)
    with Twin.open(tmp_path / "cart.toml") as twin:
        twin.run(driven(seed, gain, 0.05, 0.2))
        live, known = twin.champion, twin.known_of(twin.champion.number)
    low, high = known["gain"]["interval95"]
    assert low <= gain <= high
    assert known["law.v.gain"]["value"] == 1.0
    assert known["law.v.gain"]["interval95"] is None
    told = re.search(r"start threshold (\S+) \((\S+) to (\S+)\) m/s", live.reason)
    assert told, live.reason
    assert float(told[1]) == pytest.approx(0.05, abs=0.01)
    assert float(told[2]) <= float(told[1]) <= float(told[3])
    assert "lag" not in live.reason


def test_what_may_as_well_be_nothing_is_not_said() -> None:
    lag, law = kind("lag"), kind("law")
    said = lag.say(Term("lag", "v"), (0.002, 0.2), "", {"delay": (0.0, 0.02)})
    assert said == "v: a first-order lag of 0.2 s"
    clamp = Term("law", "v", variant="clamp")  # by nothing
    assert law.say(clamp, (0.0, 1.0, -0.1, 0.7), "m/s", {}).startswith("v: start threshold 0.1 m/s")
    small = law.say(Term("law", "v"), (1.0, -0.02, 0.7), "m/s", {"offset": (-0.05, 0.01)})
    assert small == "v: saturation at 0.7 m/s"
