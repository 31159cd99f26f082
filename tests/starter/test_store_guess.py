"""The model of one's own that `init` writes starts from what its recording says."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from evertwin.app.cli import app
from planted.draws import first_of


def vessel(seed: int, rows: int = 3000) -> tuple[np.ndarray, tuple[float, float, float]]:
    """Time [s], valve and pressure [bar] of a vessel that fills and leaks; its numbers in Pa."""
    rng = np.random.default_rng(seed)
    dt, leak = rng.choice([0.05, 0.2, 1.0]), 10 ** rng.uniform(-1.5, -0.5)
    gain, constant = leak * 10 ** rng.uniform(-1, 1.5), leak * rng.uniform(0.5, 2.0)
    valve = np.repeat(rng.uniform(0, 1, rows // 100 + 1), 100)[:rows]
    bar = np.empty(rows)
    bar[0] = constant / leak
    rest = np.exp(-leak * dt)
    for k in range(rows - 1):
        bar[k + 1] = rest * bar[k] + (gain * valve[k] + constant) * (1 - rest) / leak
    bar += rng.normal(size=rows) * 0.005 * (np.ptp(bar) + 0.01)
    return np.column_stack([np.arange(rows) * dt, valve, bar]), (gain * 1e5, leak, constant * 1e5)


@first_of("seed", range(8))
def test_the_numbers_begin_near_the_machine_in_its_units(tmp_path: Path, seed: int) -> None:
    rows, truth = vessel(seed)
    log = tmp_path / "vessel.csv"
    np.savetxt(log, rows, delimiter=",", header="t [s],valve,pressure [bar]", comments="")
    result = CliRunner().invoke(app, ["init", str(log), "-o", str(tmp_path / "v.toml")])
    assert result.exit_code == 0, result.output
    spec = importlib.util.spec_from_file_location("v_model", tmp_path / "v_model.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    numbers = module.model.parameters
    assert numbers.values[:2] == pytest.approx(truth[:2], rel=0.3)
    assert all(one.low <= true <= one.high for one, true in zip(numbers, truth, strict=True))
