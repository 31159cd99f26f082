"""Detectors in the stream: partition law, checkpoints, plain-Python twins, events."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from evertwin.anomaly import (
    Alarms,
    Calm,
    Cusum,
    Drift,
    Residuals,
    SnrLimit,
    calibrate,
    cusum,
    drift,
    snr,
)
from evertwin.errors import UsageError
from evertwin.fold import canonical, copy, equal, load, save
from evertwin.fold.laws import join

QUICK = Calm(least=200, independent=20.0)


def rows(n: int = 1500, seed: int = 0) -> Residuals:
    rng = np.random.default_rng(seed)
    r = rng.normal(size=(n, 2))
    r[900:930, 0] += 5.0
    r[1100:, 1] *= 3.0
    r[rng.random((n, 2)) < 0.1] = np.nan
    return Residuals.of(r, 3.0, np.arange(n) // 50 % 2)


ROWS = rows()
KNOWN = calibrate(ROWS.take(0, 800), QUICK, phases=2).calibration
STAGES: dict[str, tuple[Any, Callable[[], Any]]] = {}
_CUSUM = Cusum(("a", "b"), QUICK, phases=2, capacity=1024)
_SNR = SnrLimit(("a", "b"), window=7, phases=2)
_DRIFT = Drift(("a", "b"), delta=0.05, phases=2)
STAGES["cusum that calibrates itself"] = _CUSUM, _CUSUM.init
STAGES["cusum that is calibrated"] = _CUSUM, lambda: _CUSUM.begin(copy(KNOWN))
STAGES["snr"] = _SNR, lambda: _SNR.begin(copy(KNOWN))
STAGES["snr that is not calibrated"] = _SNR, _SNR.init
STAGES["drift"] = _DRIFT, lambda: _DRIFT.begin(copy(KNOWN))
STAGES["drift that is not calibrated"] = _DRIFT, _DRIFT.init


def run(name: str, cuts: list[int]) -> tuple[Any, Any]:
    stage, begin = STAGES[name]
    state, outs = begin(), []
    edges = [0, *sorted(set(cuts)), len(ROWS.r)]
    for a, b in pairwise(edges):
        if b > a:
            state, out = stage.step(state, ROWS.take(a, b))
            outs.append(out)
    return state, join(outs)


def same(a: tuple[Any, Any], b: tuple[Any, Any]) -> bool:
    return (
        equal(a[0], b[0])
        and equal(a[1].rows, b[1].rows)
        and canonical(a[1].records) == canonical(b[1].records)
    )


@pytest.mark.parametrize("name", STAGES)
def test_cuts_never_matter_down_to_single_rows(name: str) -> None:
    assert same(run(name, []), run(name, list(range(1, len(ROWS.r)))))


@pytest.mark.parametrize("name", STAGES)
@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(1, 1499), max_size=8))
def test_partition_law(name: str, cuts: list[int]) -> None:
    assert same(run(name, []), run(name, cuts))


@pytest.mark.parametrize("name", STAGES)
def test_a_checkpoint_folds_on_alike(name: str) -> None:
    stage, begin = STAGES[name]
    state, first = stage.step(begin(), ROWS.take(0, 700))
    state = load(save(copy(state)), like=begin())
    state, second = stage.step(state, ROWS.take(700, 1500))
    assert same(run(name, []), (state, join([first, second])))


def test_the_stages_find_what_was_planted() -> None:
    events = {name: list(run(name, [])[1].records) for name in STAGES}
    jumps = [e.row for e in events["cusum that is calibrated"] if e.signal == "a"]
    assert len(jumps) == 1 and 900 <= jumps[0] < 905
    assert next(e.row for e in events["snr"] if e.signal == "a") in range(900, 910)
    spreads = [e for e in events["drift"] if e.signal == "b" and e.evidence["of"] == "spread"]
    assert 1100 <= spreads[0].row < 1250
    assert events["snr that is not calibrated"] == events["drift that is not calibrated"] == []


def test_not_calibrated_is_said_with_its_reason_and_tried_again() -> None:
    rng = np.random.default_rng(1)
    r = np.concatenate([np.cumsum(rng.normal(size=400)), rng.normal(size=4000)])
    detector = Cusum(("a",), QUICK, capacity=400)
    state, out = detector.step(detector.init(), Residuals.of(r[:, None], 3.0))
    kinds = [(event.kind, event.row) for event in out.records]
    assert kinds[0] == ("not_calibrated", 199)
    assert kinds[1] == ("not_calibrated", 399)
    assert state.calibration.ready
    assert not any(kind == "suspected" for kind, _ in kinds)


def test_an_excursion_is_one_event_and_ends() -> None:
    rng = np.random.default_rng(2)
    r = rng.normal(size=(2500, 1))
    calm = calibrate(Residuals.of(rng.normal(size=(2000, 1)), 3.0), Calm()).calibration
    r[500:800] += 5.0
    r[2000:2010] -= 5.0
    detector = Cusum(("a",))
    state, out = detector.step(detector.begin(calm), Residuals.of(r, 3.0))
    assert [e.row // 100 for e in out.records] == [5, 20]
    assert out.rows.alarm[500:800].sum() > 50
    assert out.rows.alarm[2000:2010].min() == -1
    assert detector.on(state) == ()
    state, _ = detector.step(detector.begin(calm), Residuals.of(r, 3.0).take(0, 700))
    assert detector.on(state) == ("a",)
    assert detector.on(detector.restart(state)) == ()


@pytest.mark.parametrize("module", [cusum, snr, drift])
def test_compiled_and_plain_loops_agree_bit_for_bit(module: Any) -> None:
    part = ROWS.take(850, 1150)
    n, ny = part.r.shape

    def arguments() -> tuple[Any, ...]:
        if module is drift:
            return part, (8.0, 0.05, 8), _DRIFT.begin(KNOWN), np.full((n, 2 * ny), np.nan)
        out = Alarms(part.row, np.zeros((n, ny), dtype=np.int8), np.full((n, ny), np.nan))
        begins = np.zeros((n, ny), dtype=np.bool_)
        if module is cusum:
            return part, (1.5, 8.0, 100), _CUSUM.begin(KNOWN), out, begins
        return part, 6.0, _SNR.begin(KNOWN)._replace(noise=np.full(ny, 0.3)), out, begins

    def written(values: tuple[Any, ...]) -> Iterator[bytes]:
        for one in values:
            yield from written(one) if isinstance(one, tuple) else [np.asarray(one).tobytes()]

    results = []
    for loop in (module.watch.compiled, module.watch.plain):
        given = arguments()
        loop(*given)
        results.append([*written(given)])
    assert results[0] == results[1] != [*written(arguments())]


def test_noise_of_a_mean_follows_the_autoregression() -> None:
    rng = np.random.default_rng(3)
    z = lfilter([1.0], [1.0, -0.8], rng.normal(size=200_000))[:, None]
    known = calibrate(Residuals.of(z[:20_000], 3.0), Calm()).calibration
    detector = SnrLimit(("a",), window=25)
    means = z[: 25 * 8000].reshape(-1, 25).mean(axis=1) / known.scale[0, 0]
    assert detector.noise_of_means(known)[0] == pytest.approx(means.std(), rel=0.1)


def test_a_threshold_that_cannot_be_meant_is_refused() -> None:
    with pytest.raises(UsageError, match="window"):
        SnrLimit(("a",), window=0)
