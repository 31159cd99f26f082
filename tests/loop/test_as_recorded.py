"""What was learned of a sensor in another unit goes once the sensor is right again."""

from __future__ import annotations

import numpy as np
import pytest

from planted.draws import first_of
from planted.twins import opened

ROWS, AT, BACK = 3200, 1600, 2300


@first_of("seed", [4, 2, 8])
def test_a_sensor_that_is_right_again_is_not_called_wrong(seed: int) -> None:
    rng = np.random.default_rng(seed)
    inflow = np.repeat(rng.uniform(100.0, 450.0, ROWS // 40), 40) / 60_000.0
    inflow[AT - 80 : AT + 40] = 0.0021  # nearly empty: a factor leaps by next to nothing
    level = np.full(ROWS, 0.3)
    for k in range(1, ROWS):
        h = level[k - 1]
        for _ in range(10):
            h = max(h + 0.1 * (inflow[k - 1] - 0.0213 * np.sqrt(h)) / 0.5, 0.0)
        level[k] = h
    y = level + rng.normal(0.0, 0.0015, ROWS)
    y[AT:BACK] *= 3.28084
    with opened("template") as twin:
        result = twin.run({"t": np.arange(ROWS, dtype=float), "pump": inflow, "level": y})
    told = [(e.row, e.kind, e.reason) for e in result.events]
    learned = [e for e in result.of_kind("promoted") if AT < e.row < BACK]
    assert learned, told
    accused = [e for e in result.of_kind("measurement_error") if e.row >= BACK]
    assert any(e.evidence.get("factor") == pytest.approx(1 / 3.28084) for e in accused), told
    (back,) = [e for e in result.of_kind("rolled_back") if e.row >= BACK]
    assert "as recorded" in back.reason, told
    assert result.of_kind("measurement_restored")[-1].row == back.row
    assert not result.of_kind("suspected")[-1].row > back.row + 100, told
