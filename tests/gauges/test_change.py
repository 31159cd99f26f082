"""A machine that changes within the window that it is tuned on."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, Span, TuningSpec
from evertwin.fold import Block, make_block, take
from evertwin.gauges.changes.change import changed, likely, suddenly
from evertwin.gauges.rows.settled import settled
from evertwin.machines.mobile import Robot1D
from evertwin.models.corrected.corrected import build
from evertwin.models.form import Form, Term
from evertwin.tuning import Problem
from planted.draws import first_of

SPEC = TwinSpec(
    "cart", ModelSpec("robot1d"), beat=Span(seconds=10.0), prediction=PredictionSpec(horizon=5.0),
    anomaly=AnomalySpec(requirement=0.02, relative=False, window=Span(seconds=60.0)),
    tuning=TuningSpec(window=Span(seconds=600.0)),
)  # fmt: skip
CHANGE = 1507


def drive(seed: int, after: float, n: int = 2400) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(0.02, 0.2, n // 10), 10)
    gain = np.where(np.arange(n) < CHANGE, 1.1, after)
    x = np.r_[0.0, np.cumsum(gain * v)[:-1]] + rng.normal(0.0, 0.002, n)
    return {"t": np.arange(n) * 1.0, "v": v, "x": x}


@first_of("after", [0.95, 1.25])
def test_only_rows_of_the_machine_as_it_is_now_are_tuned_on(after: float) -> None:
    with Twin(SPEC) as twin:
        result = twin.run(drive(1, after))
    (changed,) = [e for e in result.events if e.kind == "changed"]
    assert abs(changed.evidence["row"] - CHANGE) <= 5
    promoted = [e.row for e in result.events if e.kind == "promoted"]
    assert len(promoted) == 2  # the first is to the machine as it was
    assert promoted[0] < CHANGE < promoted[1] < CHANGE + 240  # the window is 600 rows long
    assert result.parameters["gain"].value == pytest.approx(after, rel=0.005)


def test_a_machine_that_stays_has_not_changed() -> None:
    for seed in range(6):
        with Twin(SPEC) as twin:
            result = twin.run(drive(seed, 1.1))
        assert "changed" not in {e.kind for e in result.events}
        assert [e.kind for e in result.events].count("promoted") == 1


def test_numbers_that_tell_the_same_hide_no_change() -> None:
    """A correction's gain beside the model's own: no row tells the one from the other."""
    model = build(Robot1D(), Form((Term("law", "v"),)))
    names = ("gain", "law.v.gain")
    prior = model.parameters.with_values({"law.v.gain": 1.1})
    run = drive(0, 0.6, 2000)
    rows = make_block(run["t"].astype(np.int64) * 10**9, run["v"][:, None], run["x"][:, None])

    def pose(windows: tuple[Block, ...]) -> Problem:
        return Problem(model, windows, names, 5.0, prior=prior)

    assert abs(changed((rows,), pose) - CHANGE) <= 5


def played(seed: int, share: float, grows: bool) -> tuple[Block, Robot1D]:
    """A drive with play between the set speed and its wheel, driven harder from `CHANGE`
    on if it ``grows``; it goes ``share`` times as fast from `CHANGE` on."""
    rng, n = np.random.default_rng([seed, 3]), 2400
    harder = np.where(grows & (np.arange(n) < CHANGE), 0.4, 1.0)
    v = harder * np.repeat(rng.uniform(-1.0, 1.0, n // 10), 10)
    wheel, at = np.zeros(n), 0.0
    for k in range(n):
        at = min(max(at, v[k] - 0.15), v[k] + 0.15)
        wheel[k] = at
    speed = np.where(np.arange(n) < CHANGE, 1.0, share) * wheel
    x = np.r_[0.0, np.cumsum(speed)[:-1]] + rng.normal(0.0, 0.01, n)
    return make_block(np.arange(n) * 10**9, v[:, None], x[:, None]), Robot1D()


def test_play_of_a_drive_that_is_driven_harder_is_no_change() -> None:
    def place(seed: int, share: float, grows: bool) -> int:
        rows, model = played(seed, share, grows)
        prior = model.parameters.with_values({"gain": 0.4 if grows else 0.85})
        return changed((rows,), lambda some: Problem(model, some, ("gain",), 5.0, prior=prior))

    assert not any(place(seed, 1.0, grows=True) for seed in range(8))
    told = [abs(place(seed, 0.6, grows=False) - CHANGE) <= 60 for seed in range(8)]
    assert sum(told) >= 7


def bent(seed: int, share: float, harder: float) -> Block:
    """A drive with a hysteresis (Bouc-Wen) before its lag, driven ``harder`` from row 2400 on; it
    goes ``share`` times as fast from there on."""
    rng, late = np.random.default_rng([seed, 6]), np.arange(4000) >= 2400
    z = speed = was = 0.0
    v = np.repeat(rng.uniform(-0.4, 0.4, 250), 16) * np.where(late, harder, 1.0)
    way = np.zeros(4000)
    for k in range(4000):
        step, was = v[k] - was, v[k]
        for _ in range(4):
            z += 0.25 * (step - 0.5 * (abs(step) * z + step * abs(z)) / 0.07)
        speed += 0.4 * (v[k] - 0.6 * z - speed)
        way[k] = speed * (share if late[k] else 1.0)
    x = np.r_[0.0, np.cumsum(way)[:-1]] * 0.1 + rng.normal(0.0, 0.001, 4000)
    return make_block(np.arange(4000) * 10**8, v[:, None], x[:, None])


def test_rows_are_compared_with_those_at_which_inputs_swung_as_far() -> None:
    """Of harder driven rows those that swing as before are nearly all of the largest swings."""
    model = build(Robot1D(), Form((Term("lag", "v"), Term("law", "v"))))
    names = ("gain", "lag.v.tau", "law.v.offset")

    def place(seed: int, share: float, harder: float) -> int:
        rows = bent(seed, share, harder)
        first = settled(Problem(model, (take(rows, 0, 1200),), names, 2.0))
        prior = model.parameters.with_values(
            dict(zip(first.names, first.values.tolist(), strict=True))
        )
        rows = take(rows, 200, 3200)
        return changed((rows,), lambda some: Problem(model, some, names, 2.0, prior=prior))

    told = [place(seed, 1.0, harder) for seed in range(12) for harder in (1.5, 1.8)]
    assert sum(map(bool, told)) <= 1
    assert sum(abs(place(seed, 0.75, 1.0) - 2200) <= 100 for seed in range(12)) >= 10


def test_of_fewer_rows_than_two_blocks_nothing_is_told() -> None:
    model = Robot1D()
    for n in range(1, 20):
        assert likely(np.r_[np.zeros((n // 2, 1)), np.ones((n - n // 2, 1))]) == 0
        rows = make_block(t=np.arange(n) * 10**9, u=np.ones((n, 1)), y=np.zeros((n, 1)))
        assert changed((rows,), lambda windows: Problem(model, windows)) == 0
        assert suddenly((rows,), lambda windows: Problem(model, windows)) == ()
