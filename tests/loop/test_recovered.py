"""What wears is repaired: the version from before goes live again, whatever is on trial."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import (
    ModelSpec,
    ParameterSpec,
    PredictionSpec,
    StoreSpec,
    TuningSpec,
)
from evertwin.loop.decisions.former import began, none, with_live
from evertwin.loop.decisions.outdone import shares
from evertwin.models import Parameters
from evertwin.trial import Recovery
from planted.draws import first_of

WEARS, REPAIRED, END = 2000, 6000, 9000


def axis(seed: int, worn: float, repaired: bool) -> dict[str, np.ndarray]:
    """A force by a gain, which wears until it is repaired, or stays worn from then on."""
    rng, n = np.random.default_rng(seed), END
    u = np.sin(np.arange(n) * 0.07 + rng.uniform(0, 6)) + np.sin(np.arange(n) * 0.031)
    share = np.clip((np.arange(n) - WEARS) / (REPAIRED - WEARS), 0.0, 1.0)
    share[REPAIRED:] = 0.0 if repaired else 1.0
    gain = 1.0 + worn * share
    return {"t": np.arange(n) * 0.01, "u": u, "y": gain * u + 0.01 * rng.normal(size=n)}


def driven(x: Any, u: Any, dt: float, p: Any) -> Any:
    return x, [p[0] * u[0]]


def twin(store: str | None = None) -> Twin:
    model = FunctionModel(
        driven, Layout.of(u="1"), Layout.of(y="1"),
        parameters=Parameters.of(gain=(1.0, "1")),
    )  # fmt: skip
    spec = ModelSpec("given", {}, {"gain": ParameterSpec(editable=True)})
    asked = AnomalySpec(requirement=0.05, relative=True)
    ahead = PredictionSpec(horizon=0.1)
    kept = StoreSpec(path=store)
    return Twin(TwinSpec("axis", spec, prediction=ahead, anomaly=asked, store=kept), model)


@first_of(("seed", "worn"), [(1, 0.3), (2, -0.25)])
def test_a_repaired_machine_has_its_healthy_version_back_soon(seed: int, worn: float) -> None:
    with twin() as axis_twin:
        axis_twin.run(axis(seed, worn, repaired=True))
        went = [e for e in axis_twin.events if e.kind == "promoted"]
        back = [e for e in axis_twin.events if e.kind == "rolled_back"]
    assert any(WEARS < e.row < REPAIRED for e in went), "the worn machine was learned"
    assert [e.evidence["version"] for e in back] == [0], [e.reason for e in back]
    assert REPAIRED < back[0].row < REPAIRED + 1000
    assert "the machine is again as at version 0, as after a repair" in back[0].reason
    assert abs(back[0].evidence["since"] - REPAIRED) < 200
    assert not [e for e in went if e.row > REPAIRED]


@first_of(("seed", "worn", "goes_to"), [(1, 0.3, 1.0), (2, -0.25, 0.5)])
def test_a_repair_in_a_later_run_brings_the_version_of_an_earlier_one(
    tmp_path: Path, seed: int, worn: float, goes_to: float
) -> None:
    """Or none, where the machine is as it never was; nor while it stays worn."""
    store, n = str(tmp_path / "axis.db"), 3000
    with twin(store) as axis_twin:
        axis_twin.run(axis(seed, worn, repaired=False))
        assert not [e for e in axis_twin.events if e.kind == "rolled_back"]
    rng, k = np.random.default_rng([seed, 1]), np.arange(END, END + n)
    u = np.sin(k * 0.07) + np.sin(k * 0.031)
    gain = np.where(k < END + 1000, 1.0 + worn, goes_to)
    rows = {"t": k * 0.01, "u": u, "y": gain * u + 0.01 * rng.normal(size=n)}
    with twin(store) as axis_twin:
        went = axis_twin.run(rows).of_kind("promoted")
    back = [e for e in went if e.evidence["version"] == 0]
    if goes_to != 1.0:
        assert went and not back
        return
    assert back and 1000 < back[0].row < 2200, [(e.row, e.reason) for e in went]
    assert "again as it was then, as after a repair" in back[0].reason


def losses(seed: int, ratio: float, change: int, n: int = 400) -> np.ndarray:
    """The live version is better by ``ratio`` up to a segment, and worse by it from there on."""
    noise = np.random.default_rng(seed).uniform(0.5, 1.5, (n, 2))
    at = np.arange(float(n))[:, None]
    shared = noise * np.where(at < change, (1.0, ratio), (ratio, 1.0))
    return np.hstack([shared**2, 10.0 * at])


def decided(seed: int, ratio: float, change: int) -> int:
    recovery = Recovery()
    return recovery.step(recovery.init(), losses(seed, ratio, change))


def test_how_long_the_live_version_did_better_delays_nothing() -> None:
    for ratio, most in ((3.0, 40), (5.0, 20), (10.0, 10)):
        found = np.array([decided(seed, ratio, 300) for seed in range(100)])
        assert (found >= 300).all() and (found < 300 + most).all(), (ratio, found.max())


def test_no_version_comes_back_that_is_no_better() -> None:
    assert max(decided(seed, 1.0, 400) for seed in range(200)) < 0
    assert max(decided(seed, 1.3, 0) for seed in range(100)) < 0, "not worth a switch"


def test_where_segments_are_cut_does_not_matter() -> None:
    recovery, rows = Recovery(), losses(1, 5.0, 300)
    state = recovery.init()
    found = [k for k in range(len(rows)) if recovery.step(state, rows[k : k + 1]) >= 0]
    assert found == [decided(1, 5.0, 300)]
    assert recovery.verdict(state)[1]["since"] == pytest.approx(3000, abs=20)


@first_of("seed", [1, 2])
def test_of_several_former_versions_the_nearest_one_is_back(seed: int) -> None:
    """The first one is within what is asked, too, and far from as near as the second."""
    rng, n = np.random.default_rng(seed), 9000
    at = np.arange(n)
    u = np.sin(at * 0.07 + rng.uniform(0, 6)) + np.sin(at * 0.031)
    gain = np.where((at >= 3500) & (at < 6000), 1.9, 1.1)
    rows = {"t": at * 0.01, "u": u, "y": gain * u + 0.01 * rng.normal(size=n)}
    with twin() as plain:
        asked = replace(plain.spec.anomaly, requirement=0.15)
        model, tuning = plain.model, TuningSpec(every=10.0)
        spec = replace(plain.spec, anomaly=asked, tuning=tuning)
    with Twin(spec, model) as axis_twin:
        axis_twin.run(rows)
        went = [(e.row, e.kind, e.reason) for e in axis_twin.events if "version" in e.evidence]
        assert axis_twin.champion.values[0] == pytest.approx(1.1, rel=0.02), went
        back = [e for e in axis_twin.events if e.kind == "rolled_back" and e.row > 6000]
    assert all(e.evidence["version"] != 0 for e in back), went


@first_of(("seed", "other", "period"), [(1, 1.3, 2000), (2, 0.8, 1500), (3, 1.5, 3000)])
def test_a_machine_that_alternates_is_told_and_not_learned_anew(
    seed: int, other: float, period: int
) -> None:
    """Its two versions come back by turns, sooner than what is new is tried."""
    rng, n = np.random.default_rng(seed), 14 * period
    at = np.arange(n)
    u = np.sin(at * 0.07 + rng.uniform(0, 6)) + np.sin(at * 0.031)
    gain = np.where(at // period % 2 == 0, 1.1, 1.1 * other)
    rows = {"t": at * 0.01, "u": u, "y": gain * u + 0.01 * rng.normal(size=n)}
    with twin() as axis_twin:
        result = axis_twin.run(rows)
        versions = len(axis_twin._versions)
    said = result.of_kind("alternates")
    switches = [e for e in result.events if e.kind in ("promoted", "rolled_back")]
    assert versions <= 4 and len(said) == 1, [(e.row, e.reason) for e in switches]
    assert "goes back to each and learns nothing anew" in said[0].reason
    assert "gain 1.1" in said[0].reason and said[0].reason in result.headline.lower()
    known = [e.row % period for e in switches if e.row > said[0].row]
    assert len(known) >= 5 and max(known) <= period // 2, known
    assert not [e for e in result.of_kind("tuned") if e.row > said[0].row + period]


def test_a_version_that_is_back_is_known_before_a_change_is() -> None:
    """Inputs go where they had not been of late: whether the machine changed no fit can tell."""
    rng, n = np.random.default_rng(0), 12000
    at = np.arange(n)
    size = np.where(at < 9000, 1.0, 0.3)
    u = size * (2.5 + np.sin(at * 0.07) + np.sin(at * 0.031))
    gain = np.select([at < 3000, at < 6000, at < 9000], [1.1, 1.9, 0.7], 1.9)
    rows = {"t": at * 0.01, "u": u, "y": gain * u + 0.01 * rng.normal(size=n)}
    with twin() as axis_twin:
        axis_twin.run(rows)
        events = [e for e in axis_twin.events if e.row > 9000]
    first = next(e for e in events if e.kind == "normal")
    assert "again as at version 2" in first.reason, [(e.row, e.kind, e.reason) for e in events]
    assert abs(int(first.reason.rpartition(" ")[2]) - 9000) <= 5 and first.row < 9300


@pytest.mark.parametrize("reached", [True, False])
def test_what_never_reached_what_is_asked_was_no_machine(reached: bool) -> None:
    lives = began(with_live(none(), 0, 0), 1, 700, reached=reached)
    assert lives[-1].tolist() == [1, 700]
    assert (lives[-2].tolist() == [0, 0]) == reached


@first_of("seed", [1, 2])
def test_a_guess_that_never_was_the_machine_does_not_come_back(seed: int) -> None:
    """A machine comes to the number that the twin was configured with: that is no repair."""
    rng, n = np.random.default_rng(seed), 12000
    at = np.arange(n)
    u = np.sin(at * 0.07 + rng.uniform(0, 6)) + np.sin(at * 0.031)
    gain = np.where(at < 6000, 1.3, 1.0)
    rows = {"t": at * 0.01, "u": u, "y": gain * u + 0.01 * rng.normal(size=n)}
    with twin() as axis_twin:
        axis_twin.run(rows)
        went = [e for e in axis_twin.events if e.kind in ("promoted", "rolled_back")]
        said = [e.reason for e in axis_twin.events if "as after a repair" in e.reason]
        assert axis_twin.champion.values[0] == pytest.approx(1.0, rel=0.03)
    assert not said, said
    assert all(e.evidence["version"] != 0 for e in went), [(e.row, e.reason) for e in went]


@first_of("seed", [1, 2, 3])
def test_a_version_learned_while_little_moved_makes_room_for_the_one_before(seed: int) -> None:
    """Neither is within what is asked where the machine moves as it did, but one is much nearer."""
    rng, n = np.random.default_rng(seed), 7000
    at = np.arange(n)
    size = np.where(at < 3000, 0.2, 1.5)
    u = size * (0.6 * np.sin(at * 0.07 + rng.uniform(0, 6)) + 0.4 * np.sin(at * 0.031))
    y = np.where(abs(u) < 0.25, 1.6 * u, u + 0.15 * u**2) + 0.003 * rng.normal(size=n)
    with twin() as axis_twin:
        axis_twin.run({"t": at * 0.01, "u": u, "y": y})
        told = [(e.row, e.kind, e.reason) for e in axis_twin.events]
        went = [e for e in axis_twin.events if e.kind == "promoted"]
        back = [e for e in axis_twin.events if e.kind == "rolled_back"]
        assert went and went[0].row < 3000, told
        assert [e.evidence["version"] for e in back] == [0] and back[0].row < 6500, told
        assert "less deviation" in back[0].reason


def test_outputs_that_every_version_predicts_alike_keep_no_worse_one_live() -> None:
    """One that is harmed does, as does one that is told better by the live version."""
    alike = np.ones(3)
    live = np.append(alike, 1.0)
    assert shares({0: np.append(alike, 0.3), 1: live}, 1)[0] == pytest.approx(0.3)
    assert shares({0: np.array([3.0, 1.0, 1.0, 0.3]), 1: live}, 1)[0] > 1.0
    assert shares({0: live, 1: live}, 1)[0] == 1.0
