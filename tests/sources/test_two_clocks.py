"""A table that tells two clocks: offset, drift and scatter of the second, as planted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import inspect
from evertwin.sources.info_text import render


def written(folder: Path, second: np.ndarray, name: str = "device_time [s]") -> Path:
    t = 0.01 * np.arange(len(second))
    file = folder / "two.csv"
    columns = np.c_[t, second, np.sin(t)]
    np.savetxt(file, columns, "%.6f", ",", header=f"t [s],{name},v [m/s]", comments="")
    return file


@pytest.mark.parametrize(("offset", "drift"), [(0.3, 5e-5), (-12.0, 0.0), (1.7e9, -2e-4)])
def test_a_second_clock_is_compared(tmp_path: Path, offset: float, drift: float) -> None:
    rng = np.random.default_rng(1)
    t = 0.01 * np.arange(5000)
    found = inspect(written(tmp_path, offset + t * (1 + drift) + rng.normal(0, 0.002, 5000)))
    (clock,) = found.tables[0].clocks
    assert clock.column == "device_time"
    assert clock.offset == pytest.approx(offset + 25 * drift, abs=3e-4)
    assert abs(clock.drift - drift) < 4 * clock.drift_sigma < 2e-5
    assert clock.jitter == pytest.approx(0.002, rel=0.05)
    assert "clock device_time against t" in render(found)


@pytest.mark.parametrize("name", ["device_time [s]", "v2 [m/s]"])
def test_what_is_no_clock_is_not_compared(tmp_path: Path, name: str) -> None:
    """A time to go falls; a speed is no time, whatever it does."""
    t = 0.01 * np.arange(500)
    falls = name.startswith("device")
    assert inspect(written(tmp_path, 9 - t if falls else t, name)).tables[0].clocks == ()
