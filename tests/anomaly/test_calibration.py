"""Limits that keep the false alarms they promise, and the answer "not calibrated yet"."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from evertwin.anomaly import Calm, Cusum, Residuals, calibrate
from evertwin.anomaly.calibration import autoregression, effective, innovations
from evertwin.anomaly.run_length import MONTH, alarms, limit_for, run_length
from evertwin.errors import UsageError
from planted.draws import first_of

INTERVAL = 30.0
"""One month is 86,400 samples."""


def remembering(rng: np.random.Generator, n: int, rho: float) -> np.ndarray:
    return lfilter([1.0], [1.0, -rho], rng.normal(size=n + 300))[300:]


def test_a_textbook_cusum_cries_wolf() -> None:
    cried = 0
    for seed in range(400):
        counts = np.zeros(1, dtype=np.int64)
        e = np.random.default_rng(seed).normal(size=1000)
        alarms(e, 0.5, np.array([5.0]), counts)
        cried += counts[0] > 0
    assert 0.83 < cried / 400 < 0.95  # 0.88 for an endless number of streams


@pytest.mark.long
@first_of("rho", [0.9, -0.4, 0.0])
def test_false_alarms_keep_their_rate_over_100_seeds(rho: float) -> None:
    total, runs, length = 0, 0, 10_000
    for seed in range(100):
        rng = np.random.default_rng(seed)
        r = remembering(rng, 4000 + length, rho)
        found = calibrate(Residuals.of(r[:4000, None], INTERVAL), Calm())
        if found.reason:
            continue
        runs += 1
        detector = Cusum(("x",))
        rows = Residuals.of(r[4000:, None], INTERVAL)
        total += len(detector.step(detector.begin(found.calibration), rows)[1].records)
    assert runs >= 85  # one month's limit on half of the data: a few fail by chance
    expected = runs * length * INTERVAL / MONTH
    assert total <= expected + 3.0 * expected**0.5


def test_calm_normal_data_give_the_known_limit() -> None:
    e = np.random.default_rng(0).normal(size=20_000)
    limit = limit_for(e, 1.0, 86_400.0, np.random.default_rng(0))
    assert limit == pytest.approx(5.3, abs=0.5)  # counted on 2e7 samples


def test_increments_that_never_exceed_k_get_a_finite_limit() -> None:
    e = np.tile([0.1, -0.1], 1000)
    assert 0.0 < limit_for(e, 1.0, 1e6, np.random.default_rng(0)) < 10.0


def test_whitening_finds_the_autoregression_and_leaves_the_innovations() -> None:
    z = remembering(np.random.default_rng(1), 20_000, 0.9)
    a = autoregression(z, 6)
    assert a[0] == pytest.approx(0.9, abs=0.02)
    assert np.abs(a[1:]).max() < 0.03
    e = innovations(z, a)
    assert abs(np.corrcoef(e[1:], e[:-1])[0, 1]) < 0.03
    assert effective(z, a) == pytest.approx(20_000 * 0.1 / 1.9, rel=0.2)
    assert innovations(z, np.zeros(0)).tolist() == z.tolist()


def test_noise_that_cancels_is_not_whitened() -> None:
    white = np.random.default_rng(2).normal(size=6001)
    found = calibrate(Residuals.of((white[1:] - 0.7 * white[:-1])[:, None], 3.0), Calm())
    assert found.calibration.ar.tolist() == [[0.0] * 8]
    assert found.calibration.ready


def test_more_streams_share_the_allowance() -> None:
    assert run_length(1.0, 3.0, 12) == 12 * run_length(1.0, 3.0, 1)
    rng = np.random.default_rng(0)
    one = calibrate(Residuals.of(rng.normal(size=(4000, 1)), 3.0), Calm())
    rng = np.random.default_rng(0)
    fleet = calibrate(Residuals.of(rng.normal(size=(4000, 1)), 3.0), Calm(twins=100))
    assert fleet.calibration.limit[0] > one.calibration.limit[0] + 1.0


def test_phases_have_their_own_statistics() -> None:
    rng = np.random.default_rng(3)
    phase = np.repeat(np.arange(60) % 2, 50)
    r = np.where(phase == 1, 5.0 + rng.normal(size=3000), 0.1 * rng.normal(size=3000))
    found = calibrate(Residuals.of(r[:, None], 3.0, phase), Calm(), phases=2)
    assert found.reason == ""
    assert found.calibration.mean[:2, 0] == pytest.approx([0.0, 5.0], abs=0.1)
    assert found.calibration.scale[:2, 0] == pytest.approx([0.1, 1.0], rel=0.1)


def test_a_phase_seen_once_is_not_calibrated() -> None:
    rng = np.random.default_rng(4)
    phase = (np.arange(3000) >= 1500).astype(np.int64)
    found = calibrate(Residuals.of(rng.normal(size=(3000, 1)), 3.0, phase), Calm(), phases=2)
    assert "entered 1 times" in found.reason
    assert not found.calibration.ready


def test_a_residual_that_wanders_is_not_calibrated() -> None:
    walk = np.cumsum(np.random.default_rng(5).normal(size=3000))
    assert "worth" in calibrate(Residuals.of(walk[:, None], 3.0), Calm()).reason


def test_half_a_cycle_is_not_calibrated() -> None:
    rng = np.random.default_rng(6)
    r = rng.normal(size=4000)
    r[2500:2520] += 6.0  # what the machine does once per cycle came only in the second half
    assert "second half" in calibrate(Residuals.of(r[:, None], 3.0), Calm()).reason


def test_rows_without_a_residual_are_left_out() -> None:
    r = np.full((9000, 2), np.nan)
    r[::3, 0] = np.random.default_rng(7).normal(size=3000)
    found = calibrate(Residuals.of(r, 1.0), Calm())
    assert found.reason == "output 1: 0 calm samples, at least 1000 are needed"
    assert found.calibration.interval == 3.0


def test_settings_that_cannot_be_meant_are_refused() -> None:
    with pytest.raises(UsageError, match="above 0"):
        Calm(shift=0.0)
    with pytest.raises(UsageError, match="at least 72"):
        Calm(least=10)
    with pytest.raises(UsageError, match="capacity"):
        Cusum(("x",), capacity=1000)


def test_without_orders_nothing_is_whitened() -> None:
    assert len(autoregression(np.ones(100), 0)) == 0


def test_a_residual_that_never_changes_is_not_calibrated() -> None:
    assert effective(np.zeros(100), np.zeros(2)) == 0.0
    found = calibrate(Residuals.of(np.zeros((2000, 1)), 3.0), Calm())
    assert "worth 0 independent" in found.reason
