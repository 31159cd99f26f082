"""Smaller samples and fewer tunings: functions whose types are checked are slow."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

SMALLER = {
    "sensitivity.BUDGET": 100_000,
    "sensitivity.LINEAR": 512,
    "sensitivity.RESAMPLES": 10,
    "weights.MOST": 32,
    "weights.FEWEST": 16,
    "weights.REPEATS": 1,
}


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SMALLER.items():
            patch.setattr(f"evertwin.engineering.{name}", value)
        yield
