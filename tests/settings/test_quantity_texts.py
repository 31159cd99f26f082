"""A quantity's text: a number that can be reckoned with, and a known unit."""

from __future__ import annotations

import math
import time

import pytest

from evertwin.errors import UsageError
from evertwin.settings.quantity import as_number, number

TOO_LARGE = ["1e999 s", "1e308 km", 10**400, int("f" * 400, 16)]
NONE = ["1__0 m", "_1 s", "1_ m", "0x10 m", "nan", "9" * 400, "1e99999 s", "--1 m", "", "m"]


@pytest.mark.parametrize("value", TOO_LARGE)
def test_a_number_beyond_any_is_refused(value: str | int) -> None:
    with pytest.raises(UsageError, match="at most 1e308"):
        number(value)


@pytest.mark.parametrize("text", [*NONE, "9^999999999 m", "5 m/0", "3 dBm", "2 " + "m" * 10**6])
def test_what_is_no_quantity_is_refused_at_once(text: str) -> None:
    began = time.process_time()
    with pytest.raises(UsageError) as error:
        number(text, "m")
    assert time.process_time() - began < 1.0 and len(str(error.value)) < 200


def test_infinity_only_where_it_is_written() -> None:
    assert number("inf s") == number(math.inf) == math.inf
    with pytest.raises(UsageError, match="expected a number, got nan"):
        number(math.nan)


@pytest.mark.parametrize("text", ["9^999999999 m", "5 m/0", "1__0 m", "6 axes", "2 " + "m" * 10**6])
def test_a_free_text_stays_a_text(text: str) -> None:
    assert as_number(text) == text
