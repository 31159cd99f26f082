"""The machines of the benchmark stay as their authors wrote them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.strangers import draw, textbook
from benchmarks.strangers.score import score

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
