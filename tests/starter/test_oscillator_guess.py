"""A mass on a spring is found where one swings, and only there."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import Said, write_starter
from evertwin.starter.numbers.oscillator_guess import driven, guess_oscillator
from planted.draws import first_of


@first_of("seed", range(8))
def test_it_is_found_at_any_rate_and_through_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn, ratio = 10.0 ** rng.uniform(-1.5, 2.5), rng.uniform(0.02, 0.5)
    step = math.tau / turn / 10.0 ** rng.uniform(0.9, 2.0)
    u = np.repeat(rng.normal(size=200), 20)
    y = 3.0 * turn**2 * driven(turn**2, 2.0 * ratio * turn, step, u) - 7.0
    y += rng.normal(0.0, 0.05 * np.std(y), len(y))
    found, off = guess_oscillator(step * np.arange(len(y)), u, y)
    assert found is not None and found.hardening == 0.0
    assert found.stiffness == pytest.approx(turn**2, rel=0.05)
    assert found.damping == pytest.approx(2.0 * ratio * turn, rel=0.1)
    assert math.sqrt(off) < 0.06 * np.std(y)


@first_of("seed", range(4))
def test_what_fills_and_leaks_does_not_swing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, y = np.repeat(rng.normal(size=100), 20), np.zeros(2000)
    rest = 1.0 - 10.0 ** rng.uniform(-2.5, -1.0)
    for i in range(1999):
        y[i + 1] = rest * y[i] + u[i]
    found, _ = guess_oscillator(0.1 * np.arange(2000), u, y + rng.normal(0.0, 0.1, 2000))
    assert found is None


def hardening(seed: int, rows: int = 6000, rate: float = 400.0) -> tuple[np.ndarray, np.ndarray]:
    """Drive and place of y'' = u − k y − h y³ − d y', k = (2π 20)², h = 0.3 k, d = 12, in small
    steps."""
    rng = np.random.default_rng(seed)
    wave = np.cumsum(rng.normal(size=(8, rows)), axis=1) * 0.02
    tones = np.sin(math.tau * np.linspace(4, 40, 8)[:, None] * np.arange(rows) / rate + wave)
    k, u = (math.tau * 20.0) ** 2, (math.tau * 20.0) ** 2 * 0.12 * tones.sum(axis=0)
    y, v, out = 0.0, 0.0, np.zeros(rows)
    for i in range(rows):
        out[i] = y
        for _ in range(10):
            v += (u[i] - k * y - 0.3 * k * y**3 - 12.0 * v) / (10.0 * rate)
            y += v / (10.0 * rate)
    return u, out


def test_a_spring_that_hardens_ends_in_a_twin_that_fits(tmp_path: Path) -> None:
    u, y = hardening(1)
    lines = [f"{a:.6g},{b + 40.0:.6g}" for a, b in zip(u, y, strict=True)]  # rests anywhere
    (tmp_path / "log.csv").write_text("\n".join(["drive,answer", *lines]))
    twin = tmp_path / "twin.toml"
    said = Said(answers=["log.rate=400 Hz"])
    write_starter([tmp_path / "log.csv"], twin, ("", None), False, False, said)
    assert "hardening" in (tmp_path / "twin_model.py").read_text()
    assert "relative = false" in twin.read_text()
    told = Twin(twin).run().parameters
    assert told["stiffness"].value == pytest.approx((math.tau * 20.0) ** 2, rel=0.05)
    assert told["hardening"].value == pytest.approx(0.3 * (math.tau * 20.0) ** 2, rel=0.3)
    assert told["rest"].value == pytest.approx(40.0, abs=0.05)
