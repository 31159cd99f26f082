"""What is told of a unit without Pint is what Pint tells."""

from __future__ import annotations

from itertools import combinations

import pytest

from evertwin.signals import common_units, units

TEXTS = [
    *common_units._SCALED,
    *common_units._POWERS,
    *("1", "m/s", "m/s^2", "m/s**2", "rad/s", "rad/s^2", "1/s", "m^2", "kgm2", "kg·m²", "Nm"),
    *("Nms/rad", "Ns/m", "Nms", "Nm/A", "N.m", "J/(kg*K)", "V/A", "W/K", "J/K", "N/m"),
]


def told(texts: list[str]) -> list[object]:
    for function in (units.conversion, units.si_unit):
        function.cache_clear()
    pairs = [units.compatible(a, b) for a, b in combinations(texts, 2)]
    return [[(units.conversion(t), units.si_unit(t), units.powers(t)) for t in texts], pairs]


def test_common_units_are_what_pint_says(monkeypatch: pytest.MonkeyPatch) -> None:
    assert all(common_units.common(text) for text in TEXTS)
    without = told(TEXTS)
    monkeypatch.setattr(units, "common", lambda _: None)
    assert told(TEXTS) == without
    for function in (units.conversion, units.si_unit):
        function.cache_clear()


@pytest.mark.parametrize("text", ["inch", "cm^2", "m**(1/2)", "dimensionless", "", "kNm", "m//s"])
def test_other_units_are_left_to_pint(text: str) -> None:
    assert common_units.common(text) is None
