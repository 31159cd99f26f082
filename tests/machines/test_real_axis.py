"""The electro-mechanical positioning system: published parameters, free runs, the offset trap.

Initial state of a free run: the first sample's position, and there the slope of a cubic through 41
samples (a Savitzky-Golay derivative; at the window's edge it is one-sided).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import butter, filtfilt, savgol_filter

from evertwin.fold import Block, make_block
from evertwin.machines.drive import Drive, DriveForce
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.terms import climb_terms
from planted.draws import first_of

pytestmark = pytest.mark.data
DT = 1e-3
EDGE = 50
"""Rows left out at the ends of the record, where the filter has no neighbours."""
HORIZON, EVERY = 4000, 500
"""Rows of a training window, and from one's start to the next."""
LOW_PASS = butter(4, 60.0, fs=1.0 / DT)


def smooth(columns: np.ndarray) -> np.ndarray:
    return filtfilt(*LOW_PASS, columns, axis=0)


@dataclass(frozen=True)
class Axis:
    t: np.ndarray
    q: np.ndarray
    force: np.ndarray

    def motion(self, start: int, stop: int) -> Block:
        """Rows for the free run: position, and the speed of the first row."""
        slope = savgol_filter(self.q[start:stop], 41, 3, deriv=1, delta=DT)[0]
        y = np.full((stop - start, 2), np.nan)
        y[:, 0] = self.q[start:stop]
        y[0, 1] = slope
        return make_block(self.t[start:stop], self.force[start:stop, None], y)

    def forces(self, start: int, stop: int) -> Block:
        """Rows for the force equation: filtered speed and acceleration, force as recorded."""
        speed = np.gradient(smooth(self.q), DT)
        u = np.column_stack([speed, np.gradient(speed, DT)])
        return make_block(self.t[start:stop], u[start:stop], self.force[start:stop, None])

    def solved(self, law: str, start: int, stop: int, two_sided: bool = False) -> Fit:
        start, stop = max(start, EDGE), min(stop, len(self.q) - EDGE)
        model = DriveForce(law, two_sided)
        return solve(Problem(model, (self.forces(start, stop),), filter=smooth))

    def free_run(self, law: str, p: np.ndarray, start: int, stop: int) -> float:
        """Rms of the position in an open-loop run [mm]."""
        model = Drive(law)
        window = self.motion(start, stop)
        problem = Problem(model, (window,), prior=model.parameters.with_values(p))
        residual = problem.residuals(problem.start)[:, 0]
        return float(1e3 * np.sqrt(np.nanmean(residual**2)))

    def tuned(self, law: str, start: int, stop: int) -> np.ndarray:
        """Parameters that predict best over four seconds from the measured state."""
        model = Drive(law)
        prior = model.parameters.with_values(self.solved(law, start, stop).p)
        starts = range(start, stop - HORIZON + 1, EVERY)
        windows = tuple(self.motion(a, a + HORIZON) for a in starts)
        return solve(Problem(model, windows, prior=prior)).p


@pytest.fixture(scope="module")
def axis(data_set: Callable[[str], Path]) -> Axis:
    record = loadmat(data_set("emps") / "DATA_EMPS.mat")
    t, q, command = (record[name].ravel() for name in ("t", "qm", "vir"))
    return Axis(np.round(t * 1e9).astype(np.int64), q, float(record["gtau"][0, 0]) * command)


def splits(axis: Axis) -> tuple[tuple[tuple[int, int], tuple[int, int]], ...]:
    n = len(axis.q)
    third = n // 3
    return ((0, 2 * third), (2 * third, n)), ((n - 2 * third, n), (0, n - 2 * third))


def test_the_published_parameters_are_found(axis: Axis) -> None:
    fit = axis.solved("sign", 0, len(axis.q))
    published = {"mass": 95.11, "Fv": 203.5, "Fc": 20.39, "offset": -3.16}
    for name, value in published.items():
        assert fit[name] == pytest.approx(value, rel=0.02), name
    assert set(fit.verdict) == {"identifiable"}
    assert axis.free_run("sign", fit.p, 0, len(axis.q)) < 5.7


def test_the_offset_trap_is_refused(axis: Axis) -> None:
    (start, stop), _ = splits(axis)[0]
    fit = axis.solved("sign", start, stop, two_sided=True)
    verdicts = dict(zip(fit.names, fit.verdict, strict=True))
    assert verdicts == {
        "mass": "identifiable", "Fv": "identifiable", "Fc": "not", "offset": "not",
        "Fc_minus": "not",
    }  # fmt: skip
    assert "collinear" in fit.reasons[fit.names.index("offset")]


@pytest.mark.parametrize("split", [0, 1])
def test_the_law_is_chosen_on_held_out_force(axis: Axis, split: int) -> None:
    (start, stop), _ = splits(axis)[split]
    edges = np.linspace(max(start, EDGE), min(stop, len(axis.q) - EDGE), 7).astype(int).tolist()
    windows = tuple(axis.forces(a, b) for a, b in pairwise(edges))
    model = DriveForce("sign+direction+stribeck+root")
    ascent = climb_terms(Problem(model, windows, filter=smooth), model.rungs())
    direction, *_, root = ascent.steps
    assert direction.taken and direction.after < 0.8 * direction.before and not root.taken


@pytest.mark.slow
@first_of(
    ("split", "law", "limit"),
    [(0, "sign", 6.1), (1, "sign", 4.8), (0, "sign+direction", 3.7), (1, "sign+direction", 3.7)],
)
def test_it_runs_free_on_the_third_it_has_not_seen(
    axis: Axis, split: int, law: str, limit: float
) -> None:
    train, test = splits(axis)[split]
    assert axis.free_run(law, axis.tuned(law, *train), *test) <= limit
