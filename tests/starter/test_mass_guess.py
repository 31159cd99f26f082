"""A free mass is found where a controller holds one, and only there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import Said, write_starter
from evertwin.starter.numbers.mass_guess import guess_mass
from planted.draws import first_of
from planted.twins import written


def held(seed: int, rows: int = 6000) -> tuple[dict[str, np.ndarray], float, float]:
    """Time, push and place of a mass that a controller brings to one place after the other, at any
    scale and pace, through noise; its gain, and its weight."""
    rng = np.random.default_rng(seed)
    step, size, gain = 10.0 ** rng.uniform(-2.5, 0.5), 10.0 ** rng.uniform(-2, 2), 0.0
    pace = 0.02 / step
    gain, weight = size * 20.0 * pace**2, rng.uniform(0.3, 1.0) * size * 10.0 * pace**2
    damping, own = rng.uniform(0.0, 0.5) * pace, rng.uniform(1.5, 3.0) * pace
    goal = np.repeat(size * rng.normal(size=rows), rng.integers(100, 300, rows))[:rows]
    y, v, place, push = 0.0, 0.0, np.empty(rows), np.empty(rows)
    for k in range(rows):
        place[k] = y
        push[k] = (weight + own**2 * (goal[k] - y) - 2.0 * own * v) / gain
        push[k] += 0.005 * rng.normal()
        for _ in range(5):
            v += step / 5.0 * (gain * push[k] - damping * v - weight)
            y += step / 5.0 * v
    place += rng.normal(0.0, 0.003 * size, rows)
    return {"t [s]": step * np.arange(rows), "throttle": push, "height": place}, gain, weight


@first_of("seed", range(20))
def test_it_is_found_at_any_rate_and_through_noise(seed: int) -> None:
    columns, gain, weight = held(seed)
    found, share = guess_mass(*columns.values())
    assert found is not None and share < 0.2
    assert found.gain == pytest.approx(gain, rel=0.1)
    assert found.constant == pytest.approx(-weight, rel=0.1)


@first_of("seed", range(8))
def test_what_fills_and_leaks_is_no_mass(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, y = np.repeat(rng.normal(size=200), 20), np.zeros(4000)
    rest = 1.0 - 10.0 ** rng.uniform(-2.5, -1.0)
    for i in range(3999):
        y[i + 1] = rest * y[i] + u[i]
    noise = rng.normal(0.0, 0.05 * np.std(y), 4000)
    assert guess_mass(0.1 * np.arange(4000), u, y + noise)[1] > 0.9


def test_a_mass_that_is_held_ends_in_a_twin_that_fits(tmp_path: Path) -> None:
    columns, gain, weight = held(3)
    twin, answers = tmp_path / "twin.toml", ["u.column=throttle", "y.column=height"]
    log = written(tmp_path / "log.csv", columns)
    write_starter([log], twin, ("", None), False, False, Said(answers=answers))
    assert "a mass that is pushed" in (tmp_path / "twin_model.py").read_text()
    result = Twin(twin).fit(train=log)
    told = {item.name: item for item in result.parameters}
    assert told["gain"].value == pytest.approx(gain, rel=0.03)
    assert told["constant"].value == pytest.approx(-weight, rel=0.03)
