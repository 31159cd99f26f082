"""A text that is no unit is a mistake of the user's, whatever pint stumbles over."""

from __future__ import annotations

import time

import pytest

from evertwin.errors import UsageError
from evertwin.signals import si_unit
from evertwin.signals.units import compatible, conversion, to_si

NONE = ["Ns/mm/", "m/(s", "m**", "*m", "m)", "1/", "m**s", "'", "#", "€", "(m//s)/K"]
PASSED_OVER = ["m//s", "m;", "m%", "m,s", "m!", "m&s", "m..s", "Nm/√s", "m\u200bs", "m+", "m'"]
"""Signs that pint leaves out: ``m,s`` would be milliseconds."""
SPELLINGS = [
    ("m/s", 1.0), ("m·s", 1.0), ("m.s", 1.0), ("m s", 1.0), ("m*s", 1.0), ("m s⁻¹", 1.0),
    ("m²", 1.0), ("m ** 2", 1.0), ("kgm2", 1.0), ("J/(kg*K)", 1.0), ("N/(m/s)", 1.0),
    ("m**(1/2)", 1.0), ("% / s", 0.01), ("°/s", 0.017453292519943295), ("Δ°C", 1.0),
    ("inH2O", 249.08891), ("m s-1", 1.0), ("min-1", 1 / 60), ("U/min", 0.10471975511965977),
    ("rev/s", 6.283185307179586), ("tr/min", 0.10471975511965977), ("RPM", 0.10471975511965977),
]  # fmt: skip


@pytest.mark.parametrize("text", [*NONE, *PASSED_OVER])
def test_no_unit_is_refused_by_name(text: str) -> None:
    with pytest.raises(UsageError, match="is not known"):
        si_unit(text)


@pytest.mark.parametrize(("unit", "factor"), SPELLINGS)
def test_a_unit_may_be_spelt_in_many_ways(unit: str, factor: float) -> None:
    assert to_si(1.0, unit) == pytest.approx(factor)


@pytest.mark.parametrize(
    ("unit", "factor"), [("kNm", 1e3), ("mNm", 1e-3), ("Nmm", 1e-3), ("Nms", 1.0)]
)
def test_torques_and_impulses_may_be_prefixed(unit: str, factor: float) -> None:
    assert to_si(1.0, unit) == pytest.approx(factor)
    assert compatible(unit, "Nms" if unit == "Nms" else "Nm")


HOSTILE = [
    "9^999999999", "9**9**9**9", "m/0", "1/0", "0 m", "degC/0", "m^999999999", "m^-999999999",
    "m/" * 2000 + "s", "(m" * 300, "m" * 5000, "(((((m)))))", "m^(9^9^9)", "10^400 m", "Ym^13",
    "1e400", "1__0 m", "__import__", "m+s", "2 m", "[m]", "ℵ₀", "m^²",
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_is_evaluated(text: str) -> None:
    began = time.process_time()
    with pytest.raises(UsageError, match="is not known") as error:
        conversion(text)
    assert time.process_time() - began < 1.0
    assert len(str(error.value)) < 150


def test_a_factor_that_no_number_holds_is_refused() -> None:
    with pytest.raises(UsageError, match="too large or too small"):
        conversion("Ym^12 Ym^12")


@pytest.mark.parametrize("unit", ["dB", "dBm", "dBW", "Np", "dB/m", "octave"])
def test_a_logarithmic_unit_is_refused_with_the_way_out(unit: str) -> None:
    with pytest.raises(UsageError, match=r"logarithmic.*10\^\(x/10\)"):
        conversion(unit)
