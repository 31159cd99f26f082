"""`init` of a table with several series, one after the other, names no column of theirs as wear."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.prognosis.outlook.lone_series import wear_in


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("units", [1, 2, 7])
def test_each_unit_of_a_table_is_a_series_of_its_own(tmp_path: Path, seed: int, units: int) -> None:
    rng, lines = np.random.default_rng(seed), ["cell,cycle,capacity"]
    for cell in range(units):
        for cycle in range(int(rng.integers(20, 60))):
            lines.append(f"{10 - cell},{cycle + 1},{1.0 - 0.004 * cycle + 1e-4 * rng.normal():.5f}")
    (tmp_path / "a b.csv").write_text("\n".join(lines))
    found = wear_in(tmp_path / "a b.csv")
    assert found is not None and found.series == units
    assert found.columns == ("capacity",)
    if units > 1:
        assert found.of == "cell" and found.falls
        told = "evertwin life ONE.csv --limit X --below --fleet 'others/*.csv'"
        assert found.command("a b.csv") == told
    else:
        assert "'a b.csv'" in found.command("a b.csv")
