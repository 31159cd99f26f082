"""How far ahead a proposed twin predicts: a trial of such predictions fits into the recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read


@pytest.mark.parametrize(
    ("seconds", "rows", "horizon"),
    [
        (0.75, 1500, 0.007),
        (8.0, 1000, 0.08),
        (42.0, 1500, 0.4),
        (200.0, 2000, 1.0),
        (350.0, 700, 5.0),
    ],
)
def test_a_recording_has_room_for_a_trial(
    seconds: float, rows: int, horizon: float, tmp_path: Path
) -> None:
    t = np.linspace(0.0, seconds, rows, endpoint=False)
    level = np.cumsum(np.repeat(np.random.default_rng(0).normal(size=rows // 10), 10))
    table, out = tmp_path / "record.csv", tmp_path / "twin.toml"
    columns = np.column_stack([t, np.gradient(level), level])
    np.savetxt(table, columns, delimiter=",", header="t [s],u,y", comments="", fmt="%.8g")
    write_starter([table], out, ("python", None), force=True, as_json=False)
    assert read(out).prediction.horizon == pytest.approx(horizon)
