"""What rises by far is told though it is within what is asked, and nothing is tuned for it."""

from __future__ import annotations

import numpy as np

from evertwin.outcome.result import RunResult
from planted.draws import first_of
from tests.loop.test_recovered import twin

CHANGES, END = 4000, 7000


def ran(seed: int, gain: float, farther: float) -> RunResult:
    """A force by a gain of which the last rows are, on a machine that is a little curved; from
    `CHANGES` on with another gain, or ``farther``."""
    rng, at = np.random.default_rng(seed), np.arange(END)
    u = np.sin(at * 0.07 + rng.uniform(0, 6)) + np.sin(at * 0.031 + rng.uniform(0, 6))
    u *= np.where(at < CHANGES, 1.0, farther)
    y = u * np.where(at < CHANGES, 1.0, gain) + 0.0005 * u**3 + 0.002 * rng.normal(size=END)
    with twin() as axis:
        return axis.run({"t": at * 0.01, "u": u, "y": y})


@first_of(("seed", "gain"), [(1, 1.02), (2, 0.98), (3, 1.022)])
def test_a_change_within_what_is_asked_is_told_once(seed: int, gain: float) -> None:
    result = ran(seed, gain, 1.0)
    told = [(event.row, event.kind, event.reason) for event in result.events]
    drifts = [event for event in result.of_kind("drift") if "times" in event.evidence]
    assert [CHANGES < event.row < CHANGES + 2500 for event in drifts] == [True], told
    assert drifts[0].evidence["times"] > 3.0 and drifts[0].reason in result.headline
    assert not result.of_kind("tuned") and not result.of_kind("suspected"), told


@first_of(("seed", "farther"), [(1, 1.0), (2, 2.5), (3, 0.4), (4, 1.0)])
def test_a_machine_that_is_as_it_was_is_not(seed: int, farther: float) -> None:
    """Nor one that goes farther than it did, where the model was never as near."""
    told = [(event.row, event.kind, event.reason) for event in ran(seed, 1.0, farther).events]
    assert not {"drift", "suspected"} & {kind for _, kind, _ in told}, told
