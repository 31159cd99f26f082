"""Results go to other processes, and say how much of the rows they hold."""

from __future__ import annotations

import copy
import inspect
import json
import math
import pickle
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import (
    AnomalySpec,
    ChannelSpec,
    ModelSpec,
    PredictionSpec,
    SourceSpec,
    Span,
    StoreSpec,
)
from evertwin.errors import UsageError
from evertwin.loop import ByHand
from evertwin.models import FunctionModel, Parameters
from evertwin.outcome.result import RunResult
from evertwin.refit.recordings.fit_result import FitResult
from evertwin.signals import Layout
from evertwin.sources.spec import TimeSpec

SPEC = TwinSpec(
    "cart", ModelSpec("python"), beat=Span(20), prediction=PredictionSpec(horizon=5.0),
    anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(100)),
)  # fmt: skip


def cart() -> FunctionModel:
    def step(x, u, dt, p):  # type: ignore[no-untyped-def]
        after = x[0] + dt * p[0] * u[0]
        return [after], [after]

    layout = Layout.of(x="m")
    return FunctionModel(step, Layout.of(v="m/s"), layout, layout, Parameters.of(gain=(1.0, "1")))


def drive(n: int = 600) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    v = np.repeat(rng.uniform(0.0, 0.2, n // 10), 10)
    x = np.r_[0.0, np.cumsum(1.1 * v[:-1])] + rng.normal(0.0, 0.002, n)
    return {"t": np.arange(float(n)), "v": v, "x": x}


@pytest.fixture(scope="module")
def twin() -> Iterator[Twin]:
    with Twin(SPEC, cart()) as made:
        yield made


def said(result: RunResult | FitResult) -> str:
    return str(result)


def test_results_travel_to_another_process(twin: Twin) -> None:
    run, fit = twin.run(drive()), twin.fit(drive())
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert list(pool.map(said, (run, fit))) == [str(run), str(fit)]
    there = pickle.loads(pickle.dumps(run))  # noqa: S301
    assert there.to_dict() == run.to_dict() and there.to_pandas().equals(run.to_pandas())
    assert copy.deepcopy(fit).to_dict() == fit.to_dict()
    none = np.zeros(0)
    for model in (there.model, there.model_of(there.champion)):
        for call in (
            lambda model=model: model.initial(none),
            lambda model=model: model.observe(none, none),
            lambda model=model: model.simulate(none, np.zeros((0, 1)), none, none),
        ):
            with pytest.raises(UsageError, match="stays in the process that made it"):
                call()


def test_a_twin_says_what_to_send_in_its_place(twin: Twin) -> None:
    for copied in (pickle.dumps, copy.deepcopy):
        with pytest.raises(TypeError, match="send its twin file"):
            copied(twin)


def test_what_is_shown_of_an_object_is_one_line(twin: Twin) -> None:
    twin.run(drive())
    shown = [repr(one) for one in (twin, twin.champion, twin.forecast(5.0, drive()))]
    shown.append(repr(twin.compare(0, 0, drive())))
    assert all("\n" not in line and len(line) < 120 for line in shown)
    assert shown[0].startswith("<Twin 'cart': ") and "gain=1" in shown[1]
    assert "5 s ahead of x" in shown[2] and "is better at 0 % of 600 rows" in shown[3]


def test_thinned_rows_say_so() -> None:
    with Twin(TwinSpec("cart", ModelSpec("robot1d"))) as twin:
        whole, some = twin.run(drive(10_000)), twin.run(drive(120_000))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert whole.every == 1 and whole.to_pandas().attrs["every"] == 1
    for turn in (some.to_pandas, some.to_xarray):
        with pytest.warns(UserWarning, match=r"one of 2 rows is kept, 60000 of 120000"):
            table = turn()
        assert some.every == table.attrs["every"] == 2 and len(table["t"]) == 60_000


def test_an_interval_that_nobody_knows_is_null(twin: Twin) -> None:
    rest = {"t": np.arange(600.0), "v": np.zeros(600), "x": np.zeros(600)}
    fit = twin.fit(rest)
    assert not np.isfinite(fit.fit.interval95).any()
    (gain,) = json.loads(json.dumps(fit.to_dict()))["parameters"].values()
    assert gain["interval95"] is None
    (known,) = twin.fit(drive()).to_dict()["parameters"].values()
    assert all(map(math.isfinite, known["interval95"]))


def test_one_test_is_given_without_a_list(twin: Twin) -> None:
    alone, listed = (twin.fit(drive(), test) for test in (drive(300), [drive(300)]))
    assert alone.tests == listed.tests and len(alone.tests) == 1


def test_a_stored_run_is_looked_at_before_anything_more_is_pushed(tmp_path: Path) -> None:
    channels = {"v": ChannelSpec("v", "m/s"), "x": ChannelSpec("x", "m")}
    spec = TwinSpec(
        "cart", ModelSpec("robot1d"), store=StoreSpec(str(tmp_path / "cart.db")),
        source=(SourceSpec("log", channels, time=TimeSpec("t")),),
    )  # fmt: skip
    with Twin(spec) as first:
        first.push(drive())
    with Twin(spec) as second:
        assert len(second.view().row) == 600 and second.finish().samples == 600
        with pytest.raises(UsageError, match="no samples were pushed"):
            second.view()


def test_a_label_is_asked_for_as_such(twin: Twin) -> None:
    with pytest.raises(UsageError, match=r"expected evertwin.ledger.Label\(.*got str"):
        inspect.unwrap(ByHand.label)(twin, "seen")  # type: ignore[arg-type]
