"""The heated box on its recordings: the wall is needed, the lid is heard, calm stays calm.

Initial temperatures of heater and wall belong to a recording: they are free on each.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evertwin.anomaly import Calm, Cusum, Residuals, calibrate
from evertwin.fold import Block, make_block, take
from evertwin.machines.thermal import ThermalBox
from evertwin.models import Model
from evertwin.sync import Horizon
from evertwin.tuning import Problem, solve
from planted.score import score

pytestmark = pytest.mark.data
SETTLED = 900 * 10**9
"""Calm again: so long after a lid was closed [ns]."""


def rows(file: Path, unit: float) -> Block:
    with file.open(encoding="utf-8") as opened:
        records = list(csv.DictReader(opened))
    t = [round(float(r["time"]) * unit) if unit > 1 else int(r["time"]) for r in records]
    heater = np.array([r["heater_on"].strip() == "True" for r in records], dtype=float)
    one, two, three = (np.array([float(r[k]) for r in records]) for k in ("t1", "t2", "t3"))
    held = np.concatenate([heater[:1], heater[:-1]])  # a row's command acts from then on
    room = np.concatenate([one[:1], (one[1:] + one[:-1]) / 2]) + 273.15
    return make_block(t, np.column_stack([held, room]), ((two + three) / 2 + 273.15)[:, None])


@pytest.fixture(scope="module")
def september(data_set: Callable[[str], Path]) -> Block:
    folder = data_set("incubator") / "20200918_calibration_fan_24V"
    return rows(folder / "semi_random_movement.csv", 1e9)


@pytest.fixture(scope="module")
def march(data_set: Callable[[str], Path]) -> Block:
    folder = data_set("incubator") / "20210321_lid_opening_7pmodel"
    return rows(folder / "lid_opening_experiment_mar_2021.csv", 1)


@pytest.fixture(scope="module")
def events(data_set: Callable[[str], Path]) -> dict[str, np.ndarray]:
    file = data_set("incubator") / "20210321_lid_opening_7pmodel" / "events.csv"
    with file.open(encoding="utf-8") as opened:
        records = list(csv.DictReader(opened))
    codes = ("lid_open", "lid_close")
    return {c: np.array([int(r["time"]) for r in records if r["code"] == c]) for c in codes}


def before_the_lid(march: Block, events: dict[str, np.ndarray]) -> Block:
    return take(march, 0, int(np.searchsorted(march.t, events["lid_open"][0])))


def rms(model: Model, p: np.ndarray, window: Block, free: tuple[str, ...]) -> float:
    """Free run over the window, unmeasured initial temperatures fitted to it."""
    problem = Problem(model, (window,), free, prior=model.parameters.with_values(p))
    residual = problem.residuals(solve(problem).values)
    return float(np.sqrt(np.nanmean(residual**2)))


@pytest.mark.parametrize(("wall", "limit"), [(False, 1.05), (True, 0.25)])
def test_september_predicts_march(
    wall: bool, limit: float, september: Block, march: Block, events: dict[str, np.ndarray]
) -> None:
    box = ThermalBox(wall=wall)
    fit = solve(Problem(box, (september,)))
    error = rms(box, fit.p, before_the_lid(march, events), box.initials)
    assert error <= limit
    assert wall or error > 0.5


def steps(box: ThermalBox, p: np.ndarray, window: Block) -> Residuals:
    """One-step residuals: each prediction starts from the row before."""
    stage = Horizon(box, horizon=1.0)
    _, out = stage.step(stage.renew(stage.init(), p), window)
    n = len(window.t)
    return Residuals(np.arange(n), window.t, out.rows.residual, np.zeros(n, dtype=np.int64))


def test_limits_of_september_hear_every_lid_of_march(
    september: Block, march: Block, events: dict[str, np.ndarray]
) -> None:
    box = ThermalBox(wall=True)
    p = solve(Problem(box, (september,))).p
    calm = steps(box, p, september)
    assert "at least" in calibrate(calm.take(0, 600), Calm()).reason  # half an hour
    found = calibrate(calm, Calm())
    assert found.reason == ""
    detector = Cusum(("box",))
    _, out = detector.step(detector.begin(found.calibration), steps(box, p, march))
    opened, closed = events["lid_open"], events["lid_close"]
    edges = [int(march.t[0]), *np.column_stack([opened, closed + SETTLED]).ravel().tolist()]
    quiet = list(zip(edges[::2], [*edges[1::2], int(march.t[-1])], strict=True))
    alarms = march.t[out.rows.alarm[:, 0] != 0]
    figures = score(alarms, opened, closed, quiet)
    assert figures.found == figures.events == 7
    assert max(figures.delays) <= 15.0
    assert figures.false_alarms <= 1
    assert figures.calm_hours == pytest.approx(3.4, abs=0.1)
