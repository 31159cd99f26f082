"""Lives through the twin: from the store's history, from files, with limits, work and decisions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.spec import SCENARIO
from evertwin.config import spec
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.histories.parameter_history import history
from evertwin.prognosis.laws import Life, NotEnough
from evertwin.store import Batch, Estimate, SqliteStore

GEARBOX = spec.IndicatorSpec(
    "gain", component="gearbox", parameter="gain", limit=0.7, direction="below"
)


def cart(*indicators: spec.IndicatorSpec, **more: Any) -> Twin:
    return Twin(
        TwinSpec(
            "cart", spec.ModelSpec("robot1d"), beat=spec.Span(50),
            prediction=spec.PredictionSpec(horizon=1.0), tuning=spec.TuningSpec(every=15.0),
            indicator=indicators or (GEARBOX,), **more,
        )
    )  # fmt: skip


def recording(gain: float, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(200)
    v = 0.1 * np.sign(np.sin(0.4 * t)) + 0.05 * np.sin(1.3 * t)
    x = np.r_[0.0, np.cumsum(0.1 * gain * v[:-1])]
    return {"t": t, "v": v, "x": x + rng.normal(0.0, 3e-4, 200)}


def wear(twin: Twin, runs: int, seed: int = 0, slope: float = 0.01) -> dict[str, np.ndarray]:
    """Runs a cart that loses 1 % of its gain a run; the newest recording."""
    table: dict[str, np.ndarray] = {}
    for k in range(runs):
        table = recording(1.0 - slope * k, 100 * seed + k)
        twin.run(table)
    return table


def test_life_narrows_around_the_truth_and_resets_with_maintenance() -> None:
    twin = cart()
    wear(twin, 4)
    early = twin.life().components["gearbox"].life
    assert isinstance(early, NotEnough) and "values" in early.needs
    widths = []
    for runs in (6, 8):  # 10, then 18 in all
        for k in range(runs):
            done = 4 + sum((6, 8)[: len(widths)]) + k
            twin.run(recording(1.0 - 0.01 * done, done))
        life = twin.life().components["gearbox"].life
        assert isinstance(life, Life)
        true = 31.0 - (10 if not widths else 18)  # the gain is 0.7 in run 31
        assert life.interval95[0] - 1.0 <= true <= life.interval95[1] + 1.0
        widths.append(life.interval80[1] - life.interval80[0])
    assert widths[1] < widths[0]
    twin.maintained("gearbox", "gearbox replaced")
    assert isinstance(twin.life().components["gearbox"].life, NotEnough)
    wear(twin, 10, seed=1)
    again = twin.life().components["gearbox"]
    assert isinstance(again.life, Life) and again.life.median == pytest.approx(21.0, abs=2.0)
    assert again.age == pytest.approx(9.5) and len(again.indicator.value) == 28


def test_a_demand_on_accuracy_becomes_a_limit() -> None:
    rule = replace(GEARBOX, limit=None, accuracy=spec.AccuracySpec("x", 0.1, relative=True))
    twin = cart(rule)
    table = wear(twin, 8)
    found = twin.life(data=table).components["gearbox"].indicator.limit
    first = twin.prospect().history.moments[0].found["gain"][0]
    # the position is the gain times the way told, so 10 % of it is 10 % of the gain
    assert found.value == pytest.approx(0.9 * first, rel=1e-6) and "10 % of its rms" in found.source
    with pytest.raises(ConfigError, match="never takes x out of its tolerance"):
        cart(replace(rule, accuracy=spec.AccuracySpec("x", 1e6))).life(data=table)


def test_formulas_residuals_and_what_is_missing() -> None:
    formula = spec.IndicatorSpec("loss", formula="1 - gain", limit=0.3)
    residual = spec.IndicatorSpec("off", output="x", limit=10.0)
    twin = cart(formula, residual)
    wear(twin, 9)
    lives = twin.life()
    values = lives.components["loss"].indicator.value
    assert values == pytest.approx(0.01 * np.arange(9), abs=2e-3)
    assert np.isfinite(lives.components["loss"].indicator.sigma).all()
    assert len(lives.components["off"].indicator.value) == 9
    assert isinstance(lives.machine, Life | NotEnough)
    with pytest.raises(ConfigError, match="nothing says where its life ends"):
        cart(replace(GEARBOX, limit=None)).life()
    with pytest.raises(ConfigError, match="expected a parameter, a formula"):
        cart(spec.IndicatorSpec("nothing", limit=1.0)).life()
    with pytest.raises(ConfigError, match="no \\[\\[indicator\\]\\] tells of pump"):
        costs = {"pump": spec.CostSpec(10.0, 1.0)}
        cart(prognosis=spec.PrognosisSpec(components=costs)).life()
    with pytest.raises(UsageError, match="expected one of parameter"):
        spec.IndicatorSpec("two", parameter="a", output="b", limit=1.0)


@pytest.mark.parametrize("text", ["__import__('os')", "gain.__class__()", "f(1)", "a if b else c"])
def test_a_formula_runs_nothing_else(text: str) -> None:
    with pytest.raises(UsageError, match="formula"):
        Formula.parse(text)


def test_a_formula_that_is_not_defined_is_absent() -> None:
    assert np.isnan(Formula.parse("1 / a")({"a": 0.0}))
    assert np.isnan(Formula.parse("(0 - a) ** 0.5")({"a": 1.0}))
    assert Formula.parse("sqrt(abs(-a))")({"a": 4.0}) == 2.0


def history_file(path: Path, rows: int = 30, warm: bool = True) -> Path:
    """Friction that grows, higher when warm-up is short; replaced once."""
    rng = np.random.default_rng(5)
    lines = ["run,gain,since_start,temperature,note,maintenance"]
    for k in range(rows):
        since = float(rng.uniform(0, 7200)) if warm else 7200.0
        worn = (k if k < 10 else k - 10) * 0.01
        value = (1.0 + worn) * (1.0 + 0.2 * np.exp(-since / 1800.0)) + rng.normal(0.0, 1e-3)
        mark = "gearbox: gearbox replaced" if k == 10 else ""
        lines.append(f"{k + 1},{value:.6f},{since:.1f},{20 + k % 3},ok,{mark}")
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_history_file_with_warm_up_and_maintenance(tmp_path: Path) -> None:
    rule = replace(GEARBOX, limit=1.4, direction="above", warm_up=1800.0)
    twin = cart(rule)
    one = twin.life(history_file(tmp_path / "h.csv")).components["gearbox"]
    assert [m.note for m in one.indicator.maintenance] == ["gearbox replaced"]
    assert isinstance(one.life, Life)
    # 1 % a run since the replacement: 1.4 is reached 40 runs after it, 21 from now
    assert one.life.interval95[0] <= 21.0 <= one.life.interval95[1]
    assert one.life.median == pytest.approx(21.0, abs=3.0)
    with pytest.raises(DataError, match="did you mean 'temperature'"):
        wrong = replace(rule, covariates=("temprature",))
        cart(wrong).life(tmp_path / "h.csv")
    with pytest.raises(DataError, match=r"h\.csv:3: expected 2 cells, got 1"):
        (tmp_path / "h.csv").write_text("run,gain\n1,2\n3\n")
        twin.life(tmp_path / "h.csv")


def test_dates_count_in_the_unit_of_the_clock(tmp_path: Path) -> None:
    rows = [f"2027-03-{d:02d}T00:00:00,{1 - 0.01 * d:.3f}" for d in range(1, 21)]
    (tmp_path / "h.csv").write_text("date,gain\n" + "\n".join(rows))
    twin = cart(prognosis=spec.PrognosisSpec(clock="d"))
    one = twin.life(tmp_path / "h.csv").components["gearbox"]
    assert isinstance(one.life, Life) and one.life.unit == "d"
    assert one.life.median == pytest.approx(10.0, abs=1.0)


def test_runs_are_joined_on_every_clock() -> None:
    store = SqliteStore(":memory:")
    second = 10**9
    for run in range(3):
        for task in range(2):
            end = (task + 1) * 100 * second
            store.commit(Batch([Estimate(100 * (task + 1), 90 * second, 1, "Fc", 1.0 + run, 0.9,
                                         1.1, "identifiable", task, end)]))  # fmt: skip
    assert [m.at for m in history(store, "run").moments] == [1, 2, 3, 4, 5, 6]
    assert [m.at for m in history(store, "s").moments] == [100, 200, 300, 400, 500, 600]
    stamped = SqliteStore(":memory:")
    for k in range(3):
        time = (10**6 + 86400 * k) * second
        fit = Estimate(7, time, 1, "Fc", 1.0, 0.9, 1.1, "identifiable", 0, second)
        stamped.commit(Batch([fit]))
    assert np.diff([m.at for m in history(stamped, "d").moments]) == pytest.approx([1.0, 1.0])


def test_runs_in_which_nothing_is_tuned_are_counted() -> None:
    twin, table = cart(), recording(0.9, 1)
    twin.run(table)
    twin.run({name: column[:60] for name, column in table.items()})  # 6 s: not due yet
    twin.run(table)
    assert [m.at for m in history(twin.store, "run").moments] == [1.0, 3.0]
    seconds = [m.at for m in history(twin.store, "s").moments]
    assert seconds[1] - seconds[0] == pytest.approx(19.9 + 5.9)


def test_work_ahead_drives_wear(tmp_path: Path) -> None:
    """Twice the cycles: half the life. A slower path of the same way costs the same a cycle."""
    works = (spec.WorkSpec("weld", cycles=2.0),)
    twin = cart(work=works)
    table = wear(twin, 12)
    fast = twin.life(data=table).components["gearbox"]
    plain = replace(twin.spec, work=())
    alone = Twin(plain, store=twin.store)
    base = alone.life(data=table).components["gearbox"]
    assert fast.rate == pytest.approx(2.0)
    assert isinstance(fast.life, Life) and isinstance(base.life, Life)
    assert fast.life.median == pytest.approx(base.life.median / 2.0)
    halved = SCENARIO.parse('schema = 1\nname = "slow"\n[speed]\nfactor = 0.5', "s.toml")
    found = alone.whatif(halved, table)
    assert found.lives["gearbox"]["rate"] == pytest.approx(1.0, rel=0.02)


def test_wear_at_a_date_moves_the_parameter() -> None:
    twin = cart()
    table = wear(twin, 16)
    later = SCENARIO.parse('schema = 1\nname = "in ten runs"\nwear = 10', "s.toml")
    worn = twin.whatif(later, table).worn["gain"]
    assert worn["low95"] < 0.75 < worn["high95"] and worn["to"] == pytest.approx(0.75, abs=0.01)


def test_maintenance_needs_no_recording_where_a_limit_does() -> None:
    """A limit that is asked as an accuracy is looked for in recorded work."""
    asked = spec.AccuracySpec("x", 0.1, relative=True)
    felt = replace(GEARBOX, limit=None, accuracy=asked)
    twin = cart(felt)
    table = wear(twin, 3)
    twin.maintained("gearbox", "gearbox replaced")
    assert isinstance(twin.life(data=table).components["gearbox"].life, NotEnough)
