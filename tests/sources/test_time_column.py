"""Which column is time: never one whose unit is of another kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import inspect

N = 200
T = 0.5 * np.arange(N)
WARM = 30.0 + np.random.default_rng(0).normal(0.0, 0.2, N)


@pytest.mark.parametrize(
    ("headings", "time", "rate"),
    [
        ("X_Value [s],Heater [%],T_Tank [degC]", "X_Value", 2.0),
        ("Abszisse [s],Heizung [%],T_Behälter [°C]", "Abszisse", 2.0),
        ("x [ms],u (V),t_inlet (K)", "x", 2000.0),
        ("Elapsed/s,u/V,T/K", "Elapsed", 2.0),
        ("n,u,t_room", "n", 2.0),
        ("t,u,T_Tank [degC]", "t", 2.0),
    ],
)
def test_time_is_what_grows_in_a_unit_of_time(
    headings: str, time: str, rate: float, tmp_path: Path
) -> None:
    rows = (f"{a:g},{i % 7},{b:.2f}" for i, (a, b) in enumerate(zip(T, WARM, strict=True)))
    file = tmp_path / "log.csv"
    file.write_text("\n".join((headings, *rows)) + "\n", encoding="utf-8")
    found = inspect(file).tables[0].time
    assert found is not None
    assert found.column == time
    assert found.rate == pytest.approx(rate)
    assert not found.backward


def test_a_growing_temperature_is_no_time(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    rows = (f"{20 + 0.01 * i:g},{i % 7}" for i in range(N))
    file.write_text("\n".join(("T_Tank [degC],u", *rows)) + "\n")
    assert inspect(file).tables[0].time is None


def test_a_counter_of_hours_is_no_time_beside_one(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    rows = (f"{1000 + 0.01 * i:g},{0.1 * i:g},{i % 7}" for i in range(N))
    file.write_text("\n".join(("run [h],time [s],u", *rows)) + "\n")
    found = inspect(file).tables[0].time
    assert found is not None
    assert found.column == "time"
