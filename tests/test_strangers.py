"""The machines of the benchmark stay as their authors wrote them, and accuse no sound sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.strangers import draw, textbook, twin
from benchmarks.strangers.__main__ import write
from benchmarks.strangers.score import score
from evertwin import Twin
from planted.draws import first_of

FAMILIES = [(group, name) for group in ("known", "late") for name in draw.names(group)]


@pytest.mark.parametrize("group", ["known", "late"])
def test_the_families_are_those_that_were_fixed(group: str) -> None:
    assert (draw.HERE / group / draw.FIXED).read_text().split() == [draw.fingerprint(group)]


@pytest.mark.parametrize(("group", "family"), FAMILIES)
def test_the_same_seed_gives_the_same_machine_and_another_seed_another(
    group: str, family: str
) -> None:
    one, same, other = (draw.machine(group, family, seed) for seed in (3, 3, 4))
    for name, values in one.recordings[0].items():
        np.testing.assert_array_equal(values, same.recordings[0][name])
    assert one.own_true != other.own_true


@pytest.mark.parametrize("family", ["backlash", "skid", "bent"])
def test_the_true_form_is_worth_more_than_the_fitted_textbook_form(
    tmp_path: Path, family: str
) -> None:
    place = draw.write("late", family, 0, tmp_path)
    textbook.write(place)
    found = score(place)
    assert found.ratio["own"] == 1.0
    assert 1.2 < found.ratio["scipy"] <= found.ratio["naive"]
    assert found.closed("scipy") == 0.0


@first_of(("family", "seed"), [("spring", 10), ("direction", 4), ("deadzone", 9)])
def test_a_form_that_the_twin_does_not_have_accuses_no_sensor(
    tmp_path: Path, family: str, seed: int
) -> None:
    """A drive that runs faster for the first time: "the sign of force looks turned", "speed looks
    0.3048 times what it is"; a cart in its dead zone, whose x did not leap: "x looks 0.3048 times
    what it is"."""
    place = draw.write("known", family, seed, tmp_path)
    with Twin.open(twin.twin_file(place)) as opened:
        result = opened.run([str(one) for one in sorted(place.glob("train_*.csv"))])
    assert not [e.reason for e in result.of_kind("abnormal") if "looks" in e.reason]
    assert result.of_kind("promoted")


@pytest.mark.parametrize(("seeds", "drawn"), [("2", [0, 1]), ("31-32", [31, 32])])
def test_seeds_are_a_number_of_them_or_the_first_and_the_last(
    tmp_path: Path, seeds: str, drawn: list[int]
) -> None:
    write("known", tmp_path, seeds, ["cap"])
    assert sorted(place.name for place in tmp_path.iterdir()) == [f"cap-{n:04d}" for n in drawn]
