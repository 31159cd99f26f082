"""What rests on a pump's check valve while it stands is no pressure of the pump."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import Said, write_starter
from planted.twins import written


def recorded(file: Path, rest: float) -> Path:
    """A pump that lifts against ``rest`` [bar] of standing water, at any speed and at none."""
    rng, n = np.random.default_rng(2), 4000
    speed = np.repeat(rng.choice([0.0, 900.0, 1500.0, 2200.0, 2900.0], n // 50), 50)
    head, opens = 2.6 * (speed / 2900.0) ** 2, np.repeat(rng.uniform(0.5, 2.0, n // 40), 40)
    flow = np.sqrt(np.maximum(head - rest, 0.0) / (2e-5 + 4e-5 * opens))
    pressure = np.maximum(head - 2e-5 * flow**2, rest)
    return written(file, {
        "t [s]": 0.5 * np.arange(n), "pump speed [rpm]": speed,
        "discharge pressure [bar]": pressure + rng.normal(0.0, 0.005, n),
        "flow [l/min]": flow + rng.normal(0.0, 0.5, n),
    })  # fmt: skip


@pytest.mark.parametrize("rest", [0.0, 0.4])
def test_a_pump_that_stands_below_water_is_fitted(tmp_path: Path, rest: float) -> None:
    file, twin = recorded(tmp_path / "pump.csv", rest), tmp_path / "pump.toml"
    write_starter([file], twin, ("", None), False, False, Said())
    kept = "editable=False" in (tmp_path / "pump_model.py").read_text()
    assert kept == (rest == 0.0)
    assert Twin(twin).fit(train=file).train[0].relative_rms < 0.02
