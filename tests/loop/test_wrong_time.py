"""A unit of time that cannot be right is told before a grid is made of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.errors import DataError
from evertwin.fold import Event
from evertwin.sync.spec import ClockSpec

CART = TwinSpec("cart", ModelSpec("robot1d"), clock=ClockSpec(rate=200.0))


def columns(apart: float) -> dict[str, np.ndarray]:
    t = apart * np.arange(200)
    return {"t": t, "v": np.full(200, 0.1), "x": 0.1 * t}


def test_milliseconds_that_are_called_seconds_are_named() -> None:
    with Twin(CART) as twin, pytest.raises(DataError, match=r"every 5 s would become 1,000 rows"):
        twin.run(columns(5.0))
    with Twin(CART) as twin:
        assert twin.run(columns(0.005)).samples == 200


def test_events_of_a_recording_with_dates_are_told_with_their_time() -> None:
    with Twin(replace(CART, clock=ClockSpec())) as twin:
        result = twin.run(columns(0.005))
    dated = Event(7, 1_741_613_000 * 10**9, "suspected", "x", "off", {})
    assert "2025-03-10 13:23:20Z" in replace(result, events=(dated,)).text(every=True)
