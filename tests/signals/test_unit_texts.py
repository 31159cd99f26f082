"""A text that is no unit is a mistake of the user's, whatever pint stumbles over."""

from __future__ import annotations

import pytest

from evertwin.errors import UsageError
from evertwin.signals import si_unit
from evertwin.signals.units import compatible, to_si


@pytest.mark.parametrize("text", ["Ns/mm/", "m/(s", "m**", "*m", "m)", "1/", "m**s", "'", "#", "€"])
def test_no_unit_is_refused_by_name(text: str) -> None:
    with pytest.raises(UsageError, match="is not known"):
        si_unit(text)


@pytest.mark.parametrize(
    ("unit", "factor"), [("kNm", 1e3), ("mNm", 1e-3), ("Nmm", 1e-3), ("Nms", 1.0)]
)
def test_torques_and_impulses_may_be_prefixed(unit: str, factor: float) -> None:
    assert to_si(1.0, unit) == pytest.approx(factor)
    assert compatible(unit, "Nms" if unit == "Nms" else "Nm")
