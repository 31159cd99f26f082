"""Stamps keep every nanosecond that the file holds."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.errors import DataError, UsageError
from evertwin.sources.clocks.stamps import NO_STAMP, UNITS, to_ns, zones
from evertwin.sources.clocks.time_unit import guess

ns = st.integers(-(2**62), 2**62)


@given(st.lists(ns, min_size=1, max_size=20), st.sampled_from(sorted(UNITS)))
def test_text_is_exact(values: list[int], unit: str) -> None:
    cells = [str(Decimal(value).scaleb(-UNITS[unit])) for value in values]
    raw = np.array([cell.encode() for cell in cells])
    assert to_ns(raw, unit).tolist() == values


@given(st.lists(ns, min_size=1, max_size=20))
def test_plain_decimals_are_exact(values: list[int]) -> None:
    cells = [f"{'-' if v < 0 else ''}{abs(v) // 10**9}.{abs(v) % 10**9:09d}" for v in values]
    assert to_ns(np.array([c.encode() for c in cells]), "s").tolist() == values


@given(st.lists(st.integers(0, 4_102_444_800 * 10**9), min_size=1, max_size=10))
def test_iso_is_exact(values: list[int]) -> None:
    stamps = np.array(values).astype("datetime64[ns]")
    raw = np.array([f"{stamp}+02:00".encode() for stamp in stamps])
    assert (to_ns(raw, "iso") + 7200 * 10**9).tolist() == values
    assert to_ns(stamps, "").tolist() == values


def test_floats_lose_no_more_than_the_file() -> None:
    seconds = np.array([0.1, 1600362965.6889217, -0.25, 24.84])
    exact = [int((Decimal(float(x)) * 10**9).to_integral_value()) for x in seconds]
    assert to_ns(seconds, "s").tolist() == exact


@pytest.mark.parametrize(
    ("raw", "unit"),
    [
        (np.array([np.nan, np.inf, 1e30]), "s"),
        (np.array([2**62, -(2**62)]), "s"),
        (np.array([2**63 + 5], dtype=np.uint64), "ns"),
        (np.array([b"", b"nan", b"99999999999999999999999"]), "s"),
        (np.array([b""]), "iso"),
        (np.array(["9999-01-01", "NaT"], dtype="datetime64[D]"), "iso"),
    ],
)
def test_what_cannot_be_a_stamp(raw: np.ndarray, unit: str) -> None:
    assert (to_ns(raw, unit) == NO_STAMP).all()


@pytest.mark.parametrize("cell", [b"2021-02-30T00:00:00", b"2021-13-01 00:00", b"12:00", b"x"])
def test_no_date(cell: bytes) -> None:
    with pytest.raises(DataError, match="expected a stamp"):
        to_ns(np.array([cell]), "iso")


@pytest.mark.parametrize("cell", [b"1_000", b"1.2.3", b"abc", b"1,5"])
def test_no_number(cell: bytes) -> None:
    with pytest.raises(DataError, match="expected a stamp"):
        to_ns(np.array([cell]), "s")


def test_exponents_and_leap_seconds() -> None:
    assert to_ns(np.array([b"1.5e3", b"+2"]), "ms").tolist() == [1_500_000_000, 2_000_000]
    leap, after = to_ns(np.array([b"2016-12-31T23:59:60Z", b"2017-01-01T00:00:00Z"]), "iso")
    assert leap == after


@pytest.mark.parametrize("kind", ["S", "i8", "f8"])
def test_minutes_and_hours(kind: str) -> None:
    raw = np.array([0, 2, -3])
    cells = raw.astype("S4") if kind == "S" else raw.astype(kind)
    assert to_ns(cells, "min").tolist() == [0, 120 * 10**9, -180 * 10**9]
    assert to_ns(cells, "h").tolist() == [0, 7200 * 10**9, -10800 * 10**9]


def test_unknown_unit() -> None:
    with pytest.raises(UsageError, match="fortnight"):
        to_ns(np.array([1]), "fortnight")


def test_zones_are_told_apart() -> None:
    assert zones(np.array([b"2021-01-01 00:00Z", b"2021-01-01 00:00+01"])) == {True}


@pytest.mark.parametrize(
    ("name", "raw", "unit", "sure"),
    [
        ("t", np.array([0.0, 0.01, 0.02]), "s", True),
        ("t", np.array([b"1600362965.68", b"1600362968.72"]), "s", True),
        ("t", np.array([1600362965688, 1600362965788]), "ms", True),
        ("t", np.array([1600362965688000, 1600362965788000]), "us", True),
        ("t", np.array([1600362965688000000, 1600362965788000000]), "ns", True),
        ("stamp_us", np.array([0, 100]), "us", True),
        ("Time [ms]", np.array([0, 100]), "ms", True),
        ("minute", np.array([0.0, 0.25]), "min", True),
        ("t_min", np.array([0, 10, 20]), "min", True),
        ("Betriebszeit [h]", np.array([b"0.0", b"0.1"]), "h", True),
        ("elapsed hours", np.array([0.0, 0.5]), "h", True),
        ("Datetime", np.array([b"2004.02.12.10.32.39"]), "iso", True),
        ("t", np.array(["2020-01-01"], dtype="datetime64[s]"), "iso", True),
        ("t", np.array([0, 10, 20]), "ms", False),
        ("t", np.array([0, 10000, 20000]), "us", False),
        ("t", np.array([0, 1, 2]), "s", True),
        ("t", np.array([b"", b""]), "s", False),
        ("t", np.array([b"1e-3", b"2e-3"]), "s", True),
    ],
)
def test_unit_of_time(name: str, raw: np.ndarray, unit: str, sure: bool) -> None:
    found = guess(name, raw)
    assert (found.unit, found.sure) == (unit, sure)
