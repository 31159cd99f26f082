"""Correction terms on recordings of real mobile robots.

One procedure, one set of settings. Warthog (Baril et al., arXiv:2309.10718): windows of 2 s, even
calibration steps train, odd ones test; the score is the mean absolute error of the signed way in a
steady window, and of the longitudinal way in a transitory one. MRCLAM 6 (Leung et al., IJRR 30(8),
2011): five robots, first half trains, second half is unseen.
"""

from __future__ import annotations

import csv
import gzip
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from evertwin.correction.evidence import gather
from evertwin.correction.search.improve import Proposal, Selection, improve
from evertwin.fold import Block, make_block, take
from evertwin.machines.mobile import Differential, Odometer
from evertwin.models import Model
from evertwin.models.corrected.corrected import build
from evertwin.models.form import Form
from evertwin.trial.gate import Trial

pytestmark = [pytest.mark.data, pytest.mark.slow]

STEP = 50_000_000
ROWS = 40


class Windows(NamedTuple):
    """Windows of the Warthog: inputs (360, 40), ways per row (360, 39), and what is what."""

    v: np.ndarray
    w: np.ndarray
    path: np.ndarray
    along: np.ndarray
    steady: np.ndarray
    train: np.ndarray


@cache
def warthog(folder: Path) -> Windows:
    def columns(name: str) -> dict[str, np.ndarray]:
        with (folder / name).open() as file:
            rows = list(csv.DictReader(file))
        return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}

    summary = columns("warthog_window_summary.csv")
    c = {k: v.reshape(-1, ROWS) for k, v in columns("warthog_windows.csv").items()}
    dx, dy = np.diff(c["icp_x"], axis=1), np.diff(c["icp_y"], axis=1)
    yaw = np.unwrap(c["icp_yaw"], axis=1)
    middle = 0.5 * (yaw[:, 1:] + yaw[:, :-1])
    return Windows(
        0.15 * (c["cmd_left"] + c["cmd_right"]), 0.15 * (c["cmd_right"] - c["cmd_left"]),
        np.hypot(dx, dy) * np.sign(summary["icp_vx"])[:, None],
        dx * np.cos(middle) + dy * np.sin(middle), summary["steady_state_mask"] > 0,
        summary["calib_step"] % 2 == 0,
    )  # fmt: skip


def blocks(data: Windows, chosen: np.ndarray, way: np.ndarray, before: bool) -> list[Block]:
    """One window each; ``before``: led by the window before it, so that a lag knows its past."""
    found = []
    for k in np.flatnonzero(chosen):
        led = [k - 1] if before and k > 0 else []
        u = np.concatenate(
            [
                np.stack([data.v[j], data.w[j]], axis=1)[int(bool(led) and j == k) :]
                for j in [*led, k]
            ]
        )
        y = np.full((len(u), 2), np.nan)
        y[-ROWS:, 0] = np.r_[0.0, way[k].cumsum()]
        found.append(make_block(t=np.arange(len(u)) * STEP, u=u, y=y))
    return found


def error(model: Model, p: np.ndarray, windows: list[Block]) -> float:
    """Mean absolute error of the way over a window."""
    missed = []
    for window in windows:
        y = model.simulate(model.initial(p), window.u, window.dt, p)[1][:, 0]
        missed.append(abs(y[-1] - y[-ROWS] - window.y[-1, 0]))
    return float(np.mean(missed))


def learned(train: list[Block], kinds: tuple[str, ...]) -> tuple[Proposal, Model]:
    settings = Selection(kinds=kinds, channels=("v",))
    found = improve(Odometer(), Form(), train, 1.95, settings)
    return found, build(Odometer(), found.form)


@pytest.mark.parametrize(
    ("kinds", "limit"),
    [(("table",), 0.345), (("lag", "coupling", "law", "table", "surface"), 0.21),
     (("surface",), 0.165)],
    ids=["table", "default", "surface"],
)  # fmt: skip
def test_warthog_steady(
    data_set: Callable[[str], Path], kinds: tuple[str, ...], limit: float
) -> None:
    data = warthog(data_set("drive_warthog"))
    train = blocks(data, data.steady & data.train, data.path, False)
    test = blocks(data, data.steady & ~data.train, data.path, False)
    assert error(Odometer(), np.ones(2), test) == pytest.approx(0.406, abs=0.001)
    found, model = learned(train, kinds)
    assert error(model, found.p, test) <= limit


@pytest.mark.long
def test_warthog_transitory(data_set: Callable[[str], Path]) -> None:
    data = warthog(data_set("drive_warthog"))
    train = blocks(data, ~data.steady & data.train, data.along, True)
    test = blocks(data, ~data.steady & ~data.train, data.along, True)
    assert error(Odometer(), np.ones(2), test) == pytest.approx(2.41, abs=0.01)
    found, model = learned(train, ("lag", "coupling", "law"))
    assert "lag" in {t.kind for t in found.form.terms}
    assert error(model, found.p, test) <= 0.85


def mrclam(folder: Path, robot: int) -> Block:
    """Commands held and motion capture interpolated on 50 Hz; gaps open a task."""

    def table(name: str) -> np.ndarray:
        with gzip.open(folder / f"Robot{robot}_{name}.dat.gz", "rt") as file:
            return np.loadtxt(file)

    odometry, truth = table("Odometry"), table("Groundtruth")
    start = max(odometry[0, 0], truth[0, 0]) + 0.1
    t = np.arange(start, min(odometry[-1, 0], truth[-1, 0]) - 0.1, 0.02)
    last = np.searchsorted(odometry[:, 0], t, side="right") - 1
    near = np.clip(np.searchsorted(truth[:, 0], t), 1, len(truth) - 1)
    lost = (t - odometry[last, 0] > 1.1) | (truth[near, 0] - truth[near - 1, 0] > 0.3)
    heading = np.unwrap(truth[:, 3])
    y = np.stack(
        [np.interp(t, truth[:, 0], c) for c in (truth[:, 1], truth[:, 2], heading)], axis=1
    )
    y[lost] = np.nan
    task = np.cumsum(np.r_[0, np.diff(lost.astype(int)) > 0])
    return make_block(t=np.arange(len(t)) * 20_000_000, u=odometry[last, 1:], y=y, task=task)


def verdict(found: Proposal, unseen: Block) -> str | None:
    """The gate's verdict on the rows that the proposal has not seen."""
    base, trial = Differential(), Trial(horizon=2.0)
    pairs = []
    for model, p in ((base, np.ones(2)), (build(base, found.form), found.p)):
        seen = gather(model, (unseen,), 2.0, found.scale, p)
        pairs.append(seen.deviations(seen.residual(model, p)) ** 2)
    return trial.step(trial.init(), np.stack(pairs, axis=1))[1]


@pytest.mark.long
@pytest.mark.parametrize("robot", [2])
def test_mrclam_lag_and_slip_but_no_table(data_set: Callable[[str], Path], robot: int) -> None:
    rows = mrclam(data_set("mrclam6"), robot)
    half = len(rows.t) // 2
    train, unseen = take(rows, 0, half // 2), take(rows, half, len(rows.t))
    settings = Selection(kinds=("lag", "coupling", "table"))
    found = improve(Differential(), Form(), (train,), 2.0, settings)
    terms = {(t.kind, t.channel, t.source) for t in found.form.terms}
    assert terms == {("lag", "*", ""), ("coupling", "v", "w")}
    grip = found.p[found.names.index("coupling.v.w.inverse_grip")]
    assert 0.015 < 1.0 / grip < 0.03  # m/s · rad/s
    assert found.tried["table w"] < 0.05
    assert verdict(found, unseen) == "promote"
