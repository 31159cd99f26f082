"""What a fleet tells beside levels: lives that are alike, paces, and how much few machines are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.prognosis.laws import Indicator, Limit, learn

from .test_predicted_life import machine, told


def late(life: float, start: float, seed: int) -> Indicator:
    """Next to nothing until late; where it begins says nothing of its life."""
    at = np.linspace(0.0, 1.05 * life, 100)
    level = start + 0.1 * at / life + (at / life) ** 12
    value = level + 0.01 * np.random.default_rng(seed).standard_normal(100)
    return Indicator.of("wear", "mm", Limit(1.0), at, value).with_(name=f"m{seed}")


def test_lives_that_are_alike_count_more_than_levels_that_scatter() -> None:
    rng = np.random.default_rng(1)
    draw = [(200.0 * np.exp(0.03 * rng.standard_normal()), rng.uniform(0, 0.1)) for _ in range(24)]
    fleet = learn([late(life, start, k) for k, (life, start) in enumerate(draw[:12])])
    off = [
        np.log(told(late(life, start, seed).until(0.5 * life), fleet).median / (0.5 * life))
        for seed, (life, start) in enumerate(draw[12:], 100)
    ]
    assert np.mean(np.abs(off)) < 0.15


def test_like_machines_that_began_worn_tell_no_pace() -> None:
    fleet = learn([late(200.0, 0.2, k) for k in range(8)])
    fresh = told(late(200.0, 0.0, 100).until(60.0), fleet)
    assert fresh.pace == pytest.approx(1.0)
    assert fresh.median < 200.0


def test_few_machines_tell_less_than_many_however_often_they_are_asked() -> None:
    whole = learn([machine(k) for k in range(8)])
    part, widths = machine(100).until(60.0), []
    for fleet in (whole, replace(whole, ways=whole.ways[:3])):
        low, high = told(part, fleet).interval80
        widths.append(np.log(high / low))
    assert widths[1] > 1.2 * widths[0]
