"""The form that pays, tuned with all numbers: of several starts the one that leaves least."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from planted.draws import first_of

TWIN = """
schema = 1
name = "cart"
[model]
kind = "robot1d"
parameters.gain = { value = 0.8 }
[prediction]
horizon = 3.0
[correction]
channels = ["v"]
terms = ["lag", "law"]
in_fit = true
[[source]]
name = "cart"
time = { column = "t", unit = "s" }
channels.v = { column = "v", unit = "m/s" }
channels.x = { column = "x", unit = "m" }
"""
STEP, NOISE, GAIN = 0.05, 0.003, 0.89


def cart(seed: int) -> tuple[np.ndarray, float]:
    """A cart that follows its command by a lag: rows of t, v, x, and the lag [s]."""
    rng = np.random.default_rng(seed)
    n, tau = 3000, rng.uniform(0.5, 1.2)
    v = np.repeat(rng.uniform(-0.5, 0.5, n // 60 + 1), rng.integers(30, 90, n // 60 + 1))
    v = np.resize(v, n)
    speed, x = np.full(n, GAIN * v[0]), np.zeros(n)
    for k in range(1, n):
        speed[k] = speed[k - 1] + (GAIN * v[k - 1] - speed[k - 1]) * (1.0 - np.exp(-STEP / tau))
        x[k] = x[k - 1] + 0.5 * STEP * (speed[k] + speed[k - 1])
    return np.stack([STEP * np.arange(n), v, x + rng.normal(0.0, NOISE, n)], axis=1), tau


@first_of("seed", range(5))
def test_the_start_that_leaves_least_is_taken(tmp_path: Path, seed: int) -> None:
    rows, tau = cart(seed)
    (tmp_path / "cart.toml").write_text(TWIN)
    np.savetxt(tmp_path / "a.csv", rows, "%.9g", ",", header="t,v,x", comments="")
    with Twin.open(tmp_path / "cart.toml") as twin:
        found = twin.fit([str(tmp_path / "a.csv")])
    assert "lag" in [term.kind for term in found.form.terms]
    assert found.fit.residuals[0].rms_after < 2.0 * NOISE
    assert found.parameters["lag.tau"].value == pytest.approx(tau, rel=0.15)


@first_of("seed", range(3))
def test_terms_that_tuned_numbers_do_without_are_not_listed_as_found(
    tmp_path: Path, seed: int
) -> None:
    """Its gain is far off: terms find what tuning finds as well."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.5, 0.5, 50), 60)
    x = np.r_[0.0, np.cumsum(STEP * GAIN * v[:-1])] + rng.normal(0.0, NOISE, len(v))
    rows = np.stack([STEP * np.arange(len(v)), v, x], axis=1)
    text = TWIN.replace("value = 0.8", "value = 0.6, editable = true")
    (tmp_path / "cart.toml").write_text(text)
    np.savetxt(tmp_path / "a.csv", rows, "%.9g", ",", header="t,v,x", comments="")
    with Twin.open(tmp_path / "cart.toml") as twin:
        found = twin.fit([str(tmp_path / "a.csv")])
    (said,) = [line for line in str(found).splitlines() if line.startswith("terms: ")]
    assert not found.form.terms and "would leave hardly less" in said
