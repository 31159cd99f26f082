"""Indicators of machines whose truth is known: counts, ways, times, shares as planted."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import ArbiterSpec, PredictionSpec, Span, TuningSpec, TwinSpec
from evertwin.errors import UsageError
from evertwin.fold import Event
from evertwin.outcome.intervals import MONTH, Coverage, Rate
from evertwin.outcome.kpi import Kpi, _changes
from evertwin.outcome.result import OutputFigures, RunResult
from evertwin.twin import Twin

from .test_results import drive, spec


def worn(rows: int = 2400, at: int = 1000, seed: int = 1) -> dict[str, Any]:
    """The robot of `drive`, true to its model until its gain falls to 0.8."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(rows)
    v = 0.1 * np.sign(np.sin(0.4 * t)) + 0.05 * np.sin(1.3 * t)
    gain = np.where(np.arange(rows) < at, 1.0, 0.8)
    x = np.concatenate([[0.0], np.cumsum(0.1 * gain[:-1] * v[:-1])])
    return {"t": t, "v": v, "x": x + rng.normal(0.0, 0.001, rows)}


def quick() -> TwinSpec:
    """It tunes on rows after the change alone."""
    return replace(spec(), tuning=TuningSpec(window=Span(80)))


@pytest.fixture(scope="module")
def told() -> tuple[RunResult, Kpi, Kpi]:
    """A run over a change, with and without being told of it."""
    with Twin(quick()) as twin:
        result = twin.run(worn())
        return result, twin.kpi(result, 100.0), twin.kpi(result)


def test_times_are_those_of_the_planted_change(told: tuple[RunResult, Kpi, Kpi]) -> None:
    result, known, _ = told
    after = [e for e in result.events if e.row > 1000]
    first = {kind: next(e for e in after if e.kind == kind) for kind in ("suspected", "promoted")}
    one = next(change for change in known.changes if change.detected is not None)
    assert one.row == first["suspected"].row
    assert one.detected == pytest.approx(1e-9 * first["suspected"].time - 100.0)
    assert one.live == pytest.approx(1e-9 * first["promoted"].time - 100.0)
    assert one.tuned is not None and one.detected <= one.tuned <= one.live
    assert f"detected after {one.detected:.4g} s" in str(known)


def test_without_a_known_change_times_count_from_the_first_sign(
    told: tuple[RunResult, Kpi, Kpi],
) -> None:
    result, known, unknown = told
    first = next(e for e in result.events if e.kind == "suspected" and e.row > 1000)
    live = next(e for e in result.events if e.kind == "promoted" and e.row > 1000)
    one = next(change for change in unknown.changes if change.row == first.row)
    assert one.detected is None and one.live == pytest.approx(1e-9 * (live.time - first.time))
    assert any("no change was planted or known" in note for note in unknown.notes)
    assert not any("known" in note for note in known.notes)


def test_updates_are_the_results_and_the_way_is_the_machines(
    told: tuple[RunResult, Kpi, Kpi],
) -> None:
    result, known, _ = told
    updates = known.updates
    assert updates is not None and updates.way is not None
    assert updates.count == result.position_updates and updates.count[0] > 5
    rows = np.arange(2400) >= result.unseen_since
    true = float(np.abs(0.08 * worn()["v"][rows]).sum())
    assert updates.way == pytest.approx(true, rel=0.06)
    assert updates.tasks == pytest.approx(rows.mean())
    assert updates.rows == rows.sum()


def test_rates_count_the_whole_log_and_documents_are_plain() -> None:
    with Twin(quick()) as twin:
        first = twin.run(worn())
        second = twin.run(worn(seed=2))
        found = twin.kpi(second)
    promoted = len(first.of_kind("promoted")) + len(second.of_kind("promoted"))
    assert found.rates["promoted"].count == promoted > 0
    assert found.seconds_logged == pytest.approx(2 * 239.9)
    assert found.seconds == pytest.approx(239.9)
    content: Any = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert content["schema"] == "evertwin.kpi/1"
    updates = content["updates"]
    assert updates["per_metre"][1] == updates["count"][1] / updates["way"]
    assert set(content["outputs"]["x"]) >= {"relative_rms_before", "relative_rms_moving_after"}


def test_a_change_outside_the_run_is_refused_and_one_that_is_not_seen_is_said() -> None:
    with Twin(spec()) as twin:
        result = twin.run(drive(gain=1.0))
        with pytest.raises(UsageError, match=r"expected within 0 … 119\.9 s"):
            twin.kpi(result, 120.0)
        found = twin.kpi(result, 50.0)
    assert not found.changes and found.rates["false_retunes"].count == 0
    assert "the change at 50 s was not detected" in found.notes
    assert "before and after are one version: none was promoted" in found.notes
    assert "fewer than" in str(found)


def test_the_band_of_a_gaussian_twin_holds_95_of_100_rows() -> None:
    blended = replace(spec(), arbiter=ArbiterSpec(use="blend"))
    with Twin(blended) as twin:
        found = twin.kpi(twin.run(drive(4000, gain=1.0)))
    covered = found.coverage["x"]
    assert covered.rows > 3900 and covered.share == pytest.approx(0.95, abs=0.012)
    assert covered.interval95[0] < 0.95 < covered.interval95[1]
    assert found.updates is None and any("held to a tolerance" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_a_band_says_how_far_ahead_it_is(seed: int) -> None:
    """One sample ahead the band holds, while over the horizon the twin is off by far more."""
    reaching = replace(
        spec(), arbiter=ArbiterSpec(use="blend"), prediction=PredictionSpec(horizon=10.0)
    )
    with Twin(reaching) as twin:
        found = twin.kpi(twin.run(drive(2000, gain=1.0, seed=seed)))
    assert found.coverage["x"].ahead == pytest.approx(0.1)
    assert "inside the 95 % band 0.1 s ahead" in str(found)
    assert any("one sample ahead; 10 s ahead" in note for note in found.notes)
    with Twin(spec()) as twin:
        found = twin.kpi(twin.run(drive(2000, gain=1.0, seed=seed)))
    assert found.coverage["x"].ahead is None and "s ahead" not in str(found)


def test_the_interval_of_a_share_allows_for_rows_that_are_alike() -> None:
    held, n, seeds, carry = 0, 1500, 60, 0.9
    for seed in range(seeds):
        noise = np.random.default_rng(seed).normal(size=n)
        z = np.empty(n)
        z[0] = noise[0]
        for k in range(1, n):
            z[k] = carry * z[k - 1] + math.sqrt(1 - carry**2) * noise[k]
        one = Coverage.of(z)
        assert one.effective < 0.6 * n
        held += one.interval95[0] <= 0.95 <= one.interval95[1]
    assert held >= 0.88 * seeds
    bursts = np.where(np.arange(n) // 100 % 5 == 0, 3.0, 0.1) * np.where(np.arange(n) % 2, 1, -1)
    assert Coverage.of(bursts).effective < 0.1 * n
    whole = Coverage.of(np.random.default_rng(1).uniform(-1.0, 1.0, 50))
    assert whole.share == 1.0 and whole.interval95 == pytest.approx((0.929, 1.0), abs=0.001)
    assert Coverage.of(np.full(5, np.nan)).rows == 0


def test_the_interval_of_a_rate_is_that_of_a_poisson_count() -> None:
    assert Rate.of(3, 0.5 * MONTH).interval95 == pytest.approx((2 * 0.61867, 2 * 8.76727), rel=1e-4)
    none = Rate.of(0, 2 * MONTH)
    assert none.interval95 == pytest.approx((0.0, 1.5), abs=0.01)
    assert "fewer than 1.5 per month" in str(none)


def test_episodes_end_with_a_promotion_and_a_known_change_begins_one() -> None:
    row = np.arange(100)
    clock = np.where(row < 50, 1.0 * row, row - 1.0)  # a break of any length between two tasks
    said = [(11, "suspected"), (16, "tuned"), (21, "rejected"), (31, "suspected"),
            (41, "drift"), (61, "tuned"), (71, "promoted"), (81, "rolled_back")]  # fmt: skip
    events = tuple(Event(at, 0, kind, "", "") for at, kind in said)
    (whole,) = _changes(events, (row, clock), None)
    assert (whole.at, whole.tuned, whole.live, whole.rejected) == (10.0, 5.0, 59.0, 1)
    before, after = _changes(events, (row, clock), 35.0)
    assert before.live is None and before.rejected == 1
    assert (after.row, after.detected, after.tuned, after.live) == (41, 5.0, 24.0, 34.0)
    assert _changes(events[4:5], (row, clock), 35.0) == (replace(after, tuned=None, live=None),)


def test_a_machine_that_is_said_to_have_changed_was_detected() -> None:
    row = np.arange(100)
    said = [(11, "suspected"), (16, "tuned"), (51, "changed"), (51, "tuned")]
    events = tuple(Event(at, 0, kind, "", "") for at, kind in said)
    first, known = _changes(events, (row, 1.0 * row), 35.0)
    assert (first.row, known.row, known.detected, known.tuned) == (11, 51, 15.0, 15.0)


@pytest.mark.parametrize(("unit", "of"), [("K", "of its range"), ("m", "of its rms")])
def test_a_share_of_a_temperature_is_said_to_be_one_of_its_range(unit: str, of: str) -> None:
    one = OutputFigures(unit, 2.0, 1.0, 0.2, 0.1, 0.2, 0.1, 100, 100, 0.1)
    found = Kpi("box", 0, 10.0, 10.0, None, {"x": one}, (), {}, {})
    assert f"20.00 -> 10.00 % {of}" in str(found)


def test_figures_are_told_in_the_unit_of_the_recording(told: tuple[RunResult, Kpi, Kpi]) -> None:
    one = OutputFigures("Pa", 20_000.0, 5000.0, *[0.1] * 4, 10, 10, recorded="bar")
    text = str(replace(told[1], outputs={"p": one}))
    assert "off by 0.2 -> 0.05 bar" in text
    assert "rows inside tell that this goes on, not that the twin is right" in text
