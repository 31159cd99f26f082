"""What slow work answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, CorrectionSpec, ModelSpec, PredictionSpec
from evertwin.fold import make_block
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from planted.draws import first_of

SPEC = TwinSpec(
    "cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=5.0),
    anomaly=AnomalySpec(requirement=0.02, relative=False),
    correction=CorrectionSpec(channels=("v",), terms=("law",)),
)  # fmt: skip
N = 100


def work(twin: Twin) -> Work:
    return Work(Setup(twin.spec, twin.model), twin._versions)


def rows(gain: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    v = np.repeat(rng.uniform(0.02, 0.2, N // 10), 10)
    return v, np.cumsum(gain * v) + rng.normal(0.0, 0.002, N)


def task(twin: Twin, kind: str, gain: float, rival: float | None = None) -> Task:
    v, x = rows(gain)
    block = make_block(t=np.arange(N) * 10**9, u=v[:, None], y=x[:, None])
    other = None
    if rival is not None:
        other = twin._versions.add(twin.champion.form, {"gain": rival}, parent=0, reason="tuned")
    return Task(kind, twin.champion, (block,), 0, rival=other)


def test_beside_a_trial_only_a_much_better_candidate_is_heard() -> None:
    for rival, heard in [(1.3, False), (1.1, True)]:
        with Twin(SPEC) as twin:
            content = work(twin).content(task(twin, "fit", 1.3, rival))
        assert ("candidate" in content) == heard
        assert bool(content["events"]) == heard


def test_a_trial_that_does_not_go_well_keeps_no_better_candidate_out() -> None:
    """Of both rivals a fit would be better by a quarter; one of them gains nothing."""
    for gain, rival, heard in [(1.01, 1.005, False), (1.005, 0.9999, True)]:
        with Twin(SPEC) as twin:
            content = work(twin).content(task(twin, "fit", gain, rival))
        assert ("candidate" in content) == heard


def test_a_change_that_nothing_is_newer_than_leaves_the_trial() -> None:
    """The machine changed, and a candidate of the newest row is on trial: no row compares them."""
    rng, n = np.random.default_rng(0), 600
    v = np.repeat(rng.uniform(0.02, 0.2, n // 10), 10)
    x = np.cumsum(np.where(np.arange(n) < n // 2, 1.0, 1.3) * v) + rng.normal(0.0, 0.002, n)
    block = make_block(t=np.arange(n) * 10**9, u=v[:, None], y=x[:, None])
    with Twin(SPEC) as twin:
        live = twin.champion
        rival = twin._versions.add(live.form, {"gain": 1.1}, parent=0, reason="tuned")
        asked = Task(
            "fit", live, (block,), 0, held=True, commissioned=True, rival=replace(rival, row=n)
        )
        content = work(twin).content(asked)
    assert content["since"] >= n // 2 - 10 and "candidate" not in content


def test_a_weight_spares_scheduled_tunings_and_no_deviation() -> None:
    """A turn at which nobody is due has passed, too: else none would ever be due again."""
    rare = replace(SPEC, tuning=replace(SPEC.tuning, weights={"gain": 0.02}))
    with Twin(rare) as twin:
        one = work(twin)
        asked = task(twin, "fit", 1.3)._replace(tunings=1)
        passed = one.content(asked._replace(scheduled=True))
        tuned = one.content(asked)
        due = one.content(asked._replace(scheduled=True, tunings=50))
    assert passed["tuned"] and not passed["events"] and "next" not in passed
    for content in (tuned, due):
        assert content["candidate"]["values"]["gain"] == pytest.approx(1.3, rel=0.01)


def test_a_correction_is_looked_for_beside_the_tuned_numbers_too() -> None:
    """A machine of a tenth of the model's gain, and with a dead zone: no law reaches so far."""
    rng = np.random.default_rng(1)
    v = np.repeat(rng.uniform(0.0, 2.0, 60), 5)
    x = np.cumsum(0.1 * np.where(v > 0.5, v - 0.5, 0.0)) + rng.normal(0.0, 0.001, len(v))
    block = make_block(t=np.arange(len(v)) * 10**9, u=v[:, None], y=x[:, None])
    with Twin(SPEC) as twin:
        content = work(twin).content(Task("correct", twin.champion, (block,), 0))
    found = content["candidate"]["values"]
    effect = found["gain"] * (found["law.v.gain"] * 1.8 + found["law.v.offset"])
    assert found["gain"] < 0.5
    told = content["candidate"]["reason"], content["fit"]["parameters"]
    assert told[0].startswith("tuned gain (weak); v: ") and "gain" in told[1]
    assert effect == pytest.approx(0.13, abs=0.003)


@first_of("seed", range(3))
def test_a_number_of_the_model_wins_over_a_term_that_explains_as_much(seed: int) -> None:
    """A gain that explains a third of the deviation; the rest is noise, which no term explains."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(0.0, 0.2, 60), 5)
    x = np.cumsum(0.9 * v) + rng.normal(0.0, 0.04, len(v))
    block = make_block(t=np.arange(len(v)) * 10**9, u=v[:, None], y=x[:, None])
    with Twin(SPEC) as twin:
        content = work(twin).content(Task("correct", twin.champion, (block,), 0))
    assert content["candidate"]["reason"] == "tuned gain"
    assert content["candidate"]["values"]["gain"] == pytest.approx(0.9, abs=0.04)


@pytest.mark.parametrize(("sway", "kind"), [(0.0, "normal"), (0.2, "abnormal")])
def test_what_tuning_leaves_beyond_the_requirement_is_not_normal(sway: float, kind: str) -> None:
    """A cart that is also dragged to and fro, by what no input tells; tuned numbers are tried."""
    rng = np.random.default_rng(2)
    v = np.repeat(rng.uniform(0.02, 0.2, 60), 5)
    drag = sway * np.sin(0.3 * np.arange(len(v)))
    x = np.cumsum(1.5 * v + drag) + rng.normal(0.0, 0.002, len(v))
    block = make_block(t=np.arange(len(v)) * 10**9, u=v[:, None], y=x[:, None])
    with Twin(replace(SPEC, correction=CorrectionSpec())) as twin:
        content = work(twin).content(Task("fit", twin.champion, (block,), 0))
    told = [one for one in content["events"] if one["kind"] in ("normal", "abnormal")]
    assert [one["kind"] for one in told] == [kind]
    assert ("does not reach it" in told[0]["reason"]) is (kind == "abnormal")
    assert content["candidate"]["values"]["gain"] == pytest.approx(1.5, abs=0.3)
