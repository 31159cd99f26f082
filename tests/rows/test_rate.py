"""Times in a twin file are so many rows of the data."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, Span, TuningSpec
from evertwin.errors import UsageError
from evertwin.fold import make_block
from evertwin.rows.rate import measured

SPEC = TwinSpec(
    "cart", ModelSpec("robot1d"), beat=Span(seconds=10.0), prediction=PredictionSpec(horizon=1.0),
    tuning=TuningSpec(window=Span(seconds=100.0)),
    anomaly=AnomalySpec(requirement=0.004, relative=False, window=Span(seconds=60.0)),
)  # fmt: skip


def drive(rate: int, seconds: int = 200) -> dict[str, np.ndarray]:
    t = np.arange(seconds * rate) / rate
    v = np.random.default_rng(3).uniform(0.0, 0.2, seconds)[t.astype(int)]
    return {"t": t, "v": v, "x": np.r_[0.0, np.cumsum(1.1 * v[:-1] / rate)]}


@pytest.mark.parametrize("rate", [1, 5, 20])
def test_decisions_come_at_the_same_times(rate: int) -> None:
    with Twin(SPEC) as twin:
        events = twin.run(drive(rate)).events
    at = [next(e.time for e in events if e.kind == kind) for kind in ("suspected", "tuned")]
    # what the rest of the window cannot help is told at once; the fit waits for it
    assert np.array(at) * 1e-9 == pytest.approx([20.0, 70.0], abs=1.0)


def test_a_rate_is_that_of_the_first_rows_without_gaps() -> None:
    t = np.r_[np.arange(10), 100 + np.arange(10)] * 10**8
    rows = make_block(t, np.zeros((20, 1)), np.zeros((20, 1)))
    gap = rows.gap.copy()
    gap[10] = True
    rate, blocks = measured([rows._replace(gap=gap)])
    assert rate == pytest.approx(10.0) and sum(len(b.t) for b in blocks) == 20
    assert measured([])[0] is None


def test_one_row_has_no_rate() -> None:
    with Twin(SPEC) as twin, pytest.raises(UsageError, match="a time needs the rate of the rows"):
        twin.run({"t": [0.0], "v": [0.0], "x": [0.0]})
