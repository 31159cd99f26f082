"""A machine that wears by another course than its fleet: noticed, weighed down, and said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin.prognosis.laws import Fleet, Indicator, Life, Limit, NotEnough, learn, predict_life
from evertwin.prognosis.laws.growth.way import way_of
from evertwin.prognosis.laws.likes.likeness import at_some_age, by_chance
from evertwin.prognosis.likes.another_type import of_its_type
from evertwin.prognosis.outlook.lone_series import Series, life_of_series
from planted.draws import first_of

Form = Callable[[np.ndarray], np.ndarray]
FORMS: dict[str, Form] = {
    "linear": lambda s: s,
    "power": lambda s: s**1.8,
    "exponential": lambda s: np.expm1(2.5 * s) / np.expm1(2.5),
    "saturating": lambda s: -np.expm1(-2.0 * s) / -np.expm1(-2.0),
}


def worn(form: str, until: float, rng: np.random.Generator) -> tuple[Indicator, float]:
    """Vibration from 2 to 10 until a share of its life, and what is left of that."""
    life = rng.uniform(250.0, 450.0)
    at = np.arange(0.0, until * life, 3.5)
    value = 2.0 + 8.0 * FORMS[form](at / life) + rng.normal(0.0, 0.12, len(at))
    return Indicator.of("vibration", "mm/s", Limit(10.0), at, value), life - float(at[-1])


def fleet_of(form: str, rng: np.random.Generator) -> Fleet:
    return learn([worn(form, 1.04, rng)[0] for _ in range(6)])


def told(one: Indicator, fleet: Fleet) -> Life | NotEnough:
    return predict_life(one, fleet=of_its_type(one, fleet)[0])


@first_of(
    ("form", "others"),
    [
        ("linear", "exponential"), ("linear", "saturating"), ("power", "saturating"),
        ("exponential", "saturating"), ("saturating", "exponential"), ("linear", "power"),
    ],
)  # fmt: skip
def test_among_machines_of_another_form_the_interval_holds(form: str, others: str) -> None:
    held = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        fleet = fleet_of(others, rng)
        own, left = worn(form, rng.uniform(0.5, 0.9), rng)
        life = told(own, fleet)
        if isinstance(life, Life):
            held.append(life.interval80[0] <= left <= life.interval80[1])
    assert len(held) >= 9 and np.mean(held) >= 0.75


@pytest.mark.parametrize("form", list(FORMS))
def test_among_its_like_a_machine_is_told_by_them(form: str) -> None:
    chances, held = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        fleet = fleet_of(form, rng)
        own, left = worn(form, rng.uniform(0.5, 0.9), rng)
        life = told(own, fleet)
        assert isinstance(life, Life)
        way = way_of(own)
        assert way is not None
        chances.append(fleet.other(way))
        held.append(life.interval80[0] <= left <= life.interval80[1])
    assert np.median(chances) < 0.1 and np.mean(held) >= 0.75


def test_another_pace_is_no_other_form() -> None:
    rng = np.random.default_rng(3)
    fleet = fleet_of("exponential", rng)
    own, left = worn("exponential", 0.75, rng)
    life = told(own.with_(at=2.0 * own.at), fleet)
    assert isinstance(life, Life) and life.pace is not None
    assert 1.6 < life.pace < 2.4
    assert life.interval80[0] < 2.0 * left < life.interval80[1]


def test_a_doubt_is_said_with_its_chance_and_widens_the_answer(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    made = [worn("exponential", 1.04, rng)[0] for _ in range(4)]
    made.append(worn("exponential", 0.6, rng)[0])
    for k, one in enumerate(made):
        rows = [f"{a},{b:.3f}" for a, b in zip(one.at, one.value, strict=True)]
        (tmp_path / f"{k}.csv").write_text("d,vibration\n" + "\n".join(rows))
    fleet = tuple(tmp_path / f"{k}.csv" for k in range(4))
    found = life_of_series(Series(tmp_path / "4.csv", 10.0, fleet=fleet))
    one = found.components["vibration"]
    assert isinstance(one.life, Life) and not one.doubted
    doubted = replace(one, life=replace(one.life, other=0.4))
    assert doubted.doubted in replace(found, indicators=(doubted,)).notes
    assert "with probability 0.4" in doubted.doubted
    way = way_of(made[4])
    assert way is not None
    told = learn(made[:4]).told_of(way).remaining
    wide = by_chance(told, at_some_age(way.now), 0.4)
    assert wide[20] < told[20] and wide[-20] > told[-20]
