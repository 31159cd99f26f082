"""The adaptive window beside River's, and what it promises."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.anomaly import adwin


def width(window: np.ndarray) -> int:
    return int(window[adwin.LEVELS, adwin.WIDTH])


def detections(x: np.ndarray, delta: float) -> list[int]:
    window = adwin.new(1)[0]
    return [i for i, value in enumerate(x.tolist()) if adwin.add(window, value, delta, adwin.CLOCK)]


@pytest.mark.parametrize("seed", range(20))
def test_it_detects_where_river_does(seed: int) -> None:
    drift = pytest.importorskip("river.drift")
    rng = np.random.default_rng(seed)
    x = rng.normal(0, 0.1, 3000)
    x[1200:] += 0.3
    x[2400:] *= 2.0
    peer, found = drift.ADWIN(delta=0.002), []
    for i, value in enumerate(x.tolist()):
        peer.update(value)
        if peer.drift_detected:
            found.append(i)
    assert detections(x, 0.002)[0] == found[0]


def test_the_window_holds_what_it_says() -> None:
    window = adwin.new(1)[0]
    x = np.random.default_rng(0).normal(3.0, 1.0, 5000)
    for value in x.tolist():
        adwin.add(window, value, 1e-9, 32)
    total = window[adwin.LEVELS]
    assert total[adwin.WIDTH] == 5000
    assert total[adwin.TOTAL] / 5000 == pytest.approx(x.mean())
    assert total[adwin.SPREAD] / 5000 == pytest.approx(x.var())
    buckets = window[: adwin.LEVELS, adwin.USED]
    assert (buckets * 2.0 ** np.arange(adwin.LEVELS)).sum() == 5000


def test_after_a_jump_the_old_part_is_forgotten() -> None:
    rng = np.random.default_rng(1)
    window = adwin.new(1)[0]
    for value in np.concatenate([rng.normal(0, 1, 3000), rng.normal(5, 1, 3000)]).tolist():
        adwin.add(window, value, 1e-3, 32)
    assert window[adwin.LEVELS, adwin.TOTAL] / width(window) == pytest.approx(5.0, abs=0.1)
    assert 2500 < width(window) <= 3100


@pytest.mark.slow
def test_calm_data_rarely_lose_their_past() -> None:
    lost = sum(
        len(detections(np.random.default_rng(seed).normal(size=3000), 1e-4)) > 0
        for seed in range(100)
    )
    assert lost <= 2


def test_compiled_and_plain_python_agree_bit_for_bit() -> None:
    x = np.random.default_rng(2).normal(size=700)
    x[400:] += 2.0
    compiled, plain = adwin.new(2)
    for value in x.tolist():
        a = adwin.add.compiled(compiled, value, 0.01, 8)
        b = adwin.add.plain(plain, value, 0.01, 8)
        assert a == b
    assert compiled.tobytes() == plain.tobytes()
