"""Milliseconds that are read as seconds are asked for; rows of one a second are not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import ModelSpec, PredictionSpec
from evertwin.models import FunctionModel, Parameters
from evertwin.rows.time_scale import doubt, remembers
from evertwin.signals import Layout
from evertwin.types import Vector


def box(constant: float) -> FunctionModel:
    """One state that follows its input with a time constant [s]."""

    def step(x: Vector, u: Vector, dt: float, p: Vector) -> tuple[list[float], list[float]]:
        after = u[0] + (x[0] - u[0]) * math.exp(-dt / p[0])
        return [after], [after]

    layout = Layout.of(y="V")
    return FunctionModel(step, Layout.of(u="V"), layout, layout, Parameters.of(T=(constant, "s")))


def test_the_time_constant_is_that_of_the_model() -> None:
    for constant in (0.05, 2.0, 900.0):
        assert remembers(box(constant), 0.01) == pytest.approx(constant, rel=1e-6)


def test_of_drawn_machines_and_loggers_only_the_misread_ones_are_asked() -> None:
    """A logger takes 5 to 100 rows over the time that matters; half of them write milliseconds."""
    asked, wrong = 0, 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        constant = 10 ** rng.uniform(-1.0, 4.0)
        true = float(rng.choice([0.01, 0.02, 0.05, 0.1, 0.5, 1, 2, 5, 10, 30, 60, 300]))
        rows = rng.uniform(5.0, 100.0)
        constant = true * rows if rng.random() < 0.5 else constant
        horizon = true * rows if rng.random() < 0.5 else math.inf
        if math.isinf(horizon) and constant < true:  # nobody follows a machine by such rows
            continue
        if true >= 1.0:
            wrong += bool(doubt(true, "s", horizon, box(constant)))
        elif constant < 20.0 * true or math.isfinite(horizon):
            said = doubt(1000 * true, "s", horizon, box(constant))
            asked += "are the stamps ms" in said
            assert said, f"seed {seed}: rows of {true} s, {constant:.3g} s, {horizon:.3g} s"
    assert wrong == 0 and asked > 30


def test_no_static_model_no_minute_and_no_date_is_asked() -> None:
    assert not doubt(20.0, "s", 0.5, gain())
    assert not doubt(60.0, "s", 0.5, box(0.1)) and not doubt(0.0, "s", 0.5, box(0.1))
    assert not doubt(20.0, "iso", 0.5, box(0.1))
    with Twin(SPEC) as twin:
        dated = log().assign(t=pd.Timestamp("2027-03-01") + pd.to_timedelta(log().t, unit="s"))
        assert not twin.run(dated).left_out


def gain() -> FunctionModel:
    def step(x: Vector, u: Vector, dt: float, p: Vector) -> tuple[list[float], list[float]]:
        return [], [p[0] * u[0]]

    names = Layout.of(u="V"), Layout.of(y="V")
    return FunctionModel(step, *names, Layout(), Parameters.of(k=(1.0, "1")))


SPEC = TwinSpec("cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=0.5))


def log() -> pd.DataFrame:
    v = np.repeat(np.random.default_rng(3).uniform(0.0, 0.2, 60), 10)
    return pd.DataFrame({"t": 20 * np.arange(600), "v": v, "x": np.cumsum(0.02 * v)})


def test_fit_run_and_doctor_say_so_first() -> None:
    said = "are the stamps ms (whole numbers that advance by 20), read as s?"
    with Twin(SPEC) as twin:
        result, fit, found = twin.run(log()), twin.fit(log()), twin.doctor(log())
    for text in (str(result), str(fit)):
        assert said in text.splitlines()[0]
    assert result.left_out[0].finding and fit.left_out[0].finding
    assert any(said in one.reason for one in found.findings)
    with Twin(replace(SPEC, prediction=PredictionSpec(horizon=100.0))) as twin:
        assert not twin.run(log()).left_out


def test_no_number_is_identifiable_before_the_question_is_answered() -> None:
    for ms in (True, False):
        rows = log() if ms else log().assign(t=log().t / 1000.0)
        with Twin(SPEC) as twin:
            found = twin.fit(rows)
            told = twin.run(rows).to_dict()["parameters"]
        assert ("identifiable" in found.fit.verdict) is not ms, str(found)
        if ms:
            assert "told once the question of columns" in found.fit.reasons[0]
            assert str(found).startswith("look at columns first: rows come every 20 s")
        assert isinstance(told, dict)
        words = {one["verdict"] for one in told.values() if isinstance(one, dict)}
        assert "identifiable" not in words or not ms
