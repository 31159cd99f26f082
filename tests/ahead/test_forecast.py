"""Forecasts: bands hold what they say, errors name the cure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.basis import Future, coming
from evertwin.ahead.forecasting import forecast
from evertwin.ahead.spread import spread
from evertwin.config import spec
from evertwin.errors import DataError, UsageError
from evertwin.fold import make_block
from planted.draws import first_of


def cart() -> Twin:
    return Twin(
        TwinSpec(
            "cart", spec.ModelSpec("robot1d"), beat=spec.Span(20),
            prediction=spec.PredictionSpec(horizon=5.0),
            anomaly=spec.AnomalySpec(requirement=0.01, relative=False, window=spec.Span(100)),
        )
    )  # fmt: skip


def world(seed: int, rows: int = 400) -> dict[str, np.ndarray]:
    """A cart that is 8 % too fast, with noise of process (5 mm/s) and sensor (3 mm)."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(0.0, 0.2, rows // 5), 5)
    driven = 1.08 * v + rng.normal(0.0, 0.005, rows)
    x = np.r_[0.0, np.cumsum(driven[1:])] + rng.normal(0.0, 0.003, rows)
    return {"t": np.arange(float(rows)), "v": np.r_[v[1:], v[-1:]], "x": x}


@pytest.mark.long
def test_the_band_holds_the_share_that_it_says() -> None:
    inside = np.zeros(2)
    for seed in range(40):
        table = world(seed)
        known = {name: column[:340] for name, column in table.items()}
        twin = cart()
        twin.run(known)
        future = Future(np.ascontiguousarray(table["v"][339:399, None]), np.ones(60))
        out = forecast(twin.prospect().basis, 60.0, known, inputs=future).outputs["x"]
        for k, level in enumerate((0.8, 0.95)):
            low, high = out.band(level)
            inside[k] += np.mean((table["x"][340:] > low) & (table["x"][340:] < high))
    share = inside / 40
    assert 0.72 <= share[0] <= 0.92 and 0.92 <= share[1] <= 1.0


def test_noise_and_random_walk_are_told_apart() -> None:
    rng = np.random.default_rng(3)
    twin, n = cart(), 4000
    walk = np.cumsum(np.r_[0.0, rng.normal(0.0, 0.02, n - 1)])
    rows = make_block(t=np.arange(n) * 10**9, u=np.zeros((n, 1)), y=walk[:, None])
    known = spread(twin.model, np.ones(1), (rows,), 50.0)
    lead = np.array([4.0, 25.0, 49.0])
    assert known.sigma(lead)[:, 0] == pytest.approx(0.02 * np.sqrt(lead), rel=0.25)
    noise = make_block(
        t=np.arange(n) * 10**9, u=np.zeros((n, 1)), y=rng.normal(0.0, 0.1, (n, 1))
    )  # fmt: skip
    flat = spread(twin.model, np.ones(1), (noise,), 50.0)
    both = flat.sigma(np.array([1.0, 50.0]))[:, 0]
    # the start is a measurement too: sqrt(2) of its noise, at any lead
    assert both == pytest.approx(0.1 * np.sqrt(2.0), rel=0.2)
    assert known.factor[0] == pytest.approx([1.28, 1.96], rel=0.15)


def test_few_stretches_widen_the_band_and_heavy_tails_are_counted() -> None:
    rng, twin = np.random.default_rng(5), cart()

    def learnt(y: np.ndarray) -> np.ndarray:
        t, u = np.arange(len(y)) * 10**9, np.zeros((len(y), 1))
        return spread(twin.model, np.ones(1), (make_block(t=t, u=u, y=y[:, None]),), 20.0).factor[0]

    walks = [np.cumsum(rng.normal(0.0, 0.02, 80)) for _ in range(20)]
    short = np.mean([learnt(walk) for walk in walks], axis=0)
    assert 1.3 < short[0] < 1.45 and 2.0 < short[1] < 2.5
    tails = learnt(np.repeat(rng.standard_t(2.0, 300), 20) * 0.1)
    assert tails[1] / tails[0] > 1.7


def test_parameters_that_are_not_known_widen_the_band() -> None:
    twin, table = cart(), world(1)
    twin.run(table)
    found = twin.forecast(30.0, table)
    out = found.outputs["x"]
    assert found.horizon == pytest.approx(30.0) and found.mode == "repeat"
    assert out.sigma_parameters[-1] > out.sigma_parameters[0] > 0.0
    content = found.to_dict()
    assert content["schema"] == "evertwin.forecast/1" and "cart" in str(found)


def test_inputs_may_be_planned(tmp_path: Path) -> None:
    path = tmp_path / "next.csv"
    path.write_text("t,v [cm/s]\n0,10\n1,10\n2,10\n3,0\n")
    twin, table = cart(), world(2)
    twin.run(table)
    found = twin.forecast(1.0, table, inputs=path)
    gain = twin.champion.p[0]
    steps = np.diff(found.outputs["x"].value)
    assert found.mode == "planned" and steps == pytest.approx([0.1 * gain, 0.1 * gain, 0.0])


def test_what_cannot_be_forecast_is_told() -> None:
    twin, table = cart(), world(1)
    with pytest.raises(UsageError, match="above 0 s"):
        twin.forecast(0.0, table)
    with pytest.raises(DataError, match="stretches"):
        twin.forecast(10.0, {name: column[:3] for name, column in table.items()})
    rows = twin.blocks(table)[-1]
    with pytest.raises(UsageError, match="shorten it"):
        coming(rows, 1e9, "hold")
    with pytest.raises(UsageError, match="rows at this rate"):
        coming(rows, 1e308, "repeat")


def changed_world(seed: int, at: int, rows: int) -> dict[str, np.ndarray]:
    """A cart of which a wheel slips from row ``at`` on."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.3, 0.3, rows // 5), 5)
    gain = np.where(np.arange(rows) < at, 1.0, 0.7)
    x = np.r_[0.0, np.cumsum((gain * v)[1:])] + rng.normal(0.0, 0.001, rows)
    return {"t": 1e9 + np.arange(float(rows)), "v": np.r_[v[1:], v[-1:]], "x": x}


@first_of("seed", range(5))
def test_a_band_is_learnt_on_the_machine_as_it_is_now(seed: int) -> None:
    table = changed_world(seed, 1200, 2000)
    twin = cart()
    events = twin.run(table).of_kind("changed", "promoted")
    assert {event.kind for event in events} == {"changed", "promoted"}
    low, high = twin.forecast(20.0, table).outputs["x"].band(0.95)
    since = {name: column[1210:] for name, column in table.items()}
    known = twin.forecast(20.0, since).outputs["x"].band(0.95)
    assert np.all(high - low < 2.0 * (known[1] - known[0]))
    other = changed_world(seed + 100, 0, 400)  # of another time: nothing is left out
    other["t"] -= 5e6
    assert len(twin.prospect().basis.alike(twin.blocks(other))[0].t) == 400
