"""The way of a base as a derived channel."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.config.spec import DeriveSpec
from evertwin.loop.tasks import Table, _derived


def derived(op: str, x: list[float], heading: float) -> np.ndarray:
    t = np.arange(len(x), dtype=np.int64)
    columns = {"x": np.array(x), "y": np.zeros(len(x)), "a": np.full(len(x), heading)}
    rule = DeriveSpec(name="s", op=op, source=("x", "y", "a"))  # type: ignore[arg-type]
    return _derived(Table(t, columns), (rule,)).columns["s"]


def test_along_counts_forwards_and_backwards() -> None:
    assert derived("along", [0.0, 1.0, 0.5], 0.0) == pytest.approx([0.0, 1.0, 0.5])
    assert derived("along", [0.0, 1.0], np.pi) == pytest.approx([0.0, -1.0])


def test_way_is_the_length_with_one_sign_per_task() -> None:
    assert derived("way", [0.0, 1.0, 0.5], 0.0) == pytest.approx([0.0, 1.0, 1.5])
    assert derived("way", [0.0, -1.0, -0.5], 0.0) == pytest.approx([0.0, -1.0, -1.5])
