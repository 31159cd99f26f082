"""A deviation is told as soon wherever in its window the machine changes."""

from __future__ import annotations

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, Span

WINDOW, BEAT, CHANGE = 600, 10, 3000
SPEC = TwinSpec(
    "cart", ModelSpec("robot1d"), beat=Span(seconds=float(BEAT)),
    prediction=PredictionSpec(horizon=5.0),
    anomaly=AnomalySpec(  # no other detector is ready before the end
        requirement=0.02, relative=False, window=Span(seconds=float(WINDOW)), calibration=1e6,
    ),
)  # fmt: skip


def told_after(change: int) -> int:
    """Rows from a change of the gain until it is told."""
    rng, n = np.random.default_rng(0), CHANGE + 3 * WINDOW
    v = np.repeat(rng.uniform(0.02, 0.2, n // 10), 10)
    gain = np.where(np.arange(n) < change, 1.025, 0.92)
    x = np.r_[0.0, np.cumsum(gain * v)[:-1]] + rng.normal(0.0, 0.002, n)
    with Twin(SPEC) as twin:
        events = twin.run({"t": np.arange(n) * 1.0, "v": v, "x": x}).of_kind("suspected", "drift")
    return next(event.row for event in events) - change


def test_a_change_is_told_as_soon_at_any_phase_of_the_window() -> None:
    late = [told_after(CHANGE + phase) for phase in range(0, WINDOW, WINDOW // 6)]
    assert min(late) > 0 and max(late) <= 7 * BEAT, late
