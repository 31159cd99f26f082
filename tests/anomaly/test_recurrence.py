"""Contacts that come again at a place, and contacts that come at any time."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.anomaly.recurrence import Place, Recurrence

STAGE = Recurrence(inputs=3)


def after(seed: int, contacts: int, place: float | None) -> Place | None:
    """The first place found of contacts at random rows, or those where the last input is near."""
    rng = np.random.default_rng(seed)
    rows = np.stack([rng.normal(size=4000), rng.uniform(-1, 1, 4000), rng.normal(size=4000)], 1)
    there = rows if place is None else rows[np.abs(rows[:, 1] - place) < 0.04]
    state = STAGE.init()
    for at in rng.choice(len(there), contacts, replace=False):
        state, found = STAGE.found(STAGE.met(state, there[at]), rows)
        if found is not None:
            return found
    return None


def test_a_place_is_found_within_six_contacts() -> None:
    found = [after(seed, 6, 0.3) for seed in range(100)]
    right = [p for p in found if p is not None and p.column == 1 and 0.2 < p.low <= p.high < 0.4]
    assert len(right) >= 95


def test_contacts_at_any_time_make_no_place() -> None:
    assert sum(after(seed, 12, None) is not None for seed in range(100)) <= 8


def test_places_are_told_apart_from_where_nothing_was() -> None:
    state, rows = STAGE.init(), np.random.default_rng(1).uniform(-1, 1, (2000, 3))
    for x in (0.5, 0.51, 0.49, 0.5, 0.505):
        state = STAGE.met(state, np.array([0.9 * x, x, -x]))
    state, place = STAGE.found(state, rows)
    assert place is not None and STAGE.inside(state, rows).mean() < 0.05
    assert np.isnan(state.met).all()


@pytest.mark.parametrize("seed", range(4))
def test_no_place_is_narrower_than_what_its_channel_scatters_by(seed: int) -> None:
    """A machine that goes at one speed, whose measured acceleration is nothing but noise."""
    rng = np.random.default_rng(seed)
    rows, stage = rng.normal(0.0, 0.01, (5000, 1)), Recurrence(inputs=1)
    state = stage.init()
    for value in (0.0030, 0.0031, 0.0031, 0.0032):
        state = stage.met(state, np.array([value]))
    assert stage.found(state, rows)[1] is not None
    assert stage.found(state, rows, stage.noise(rows))[1] is None
