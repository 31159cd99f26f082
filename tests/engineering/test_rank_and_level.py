"""Criticality, its history, and the depth of a component's model."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.engineering.breakdown import Breakdown, System
from evertwin.engineering.criticality import YEAR, History, rank, read_history
from evertwin.engineering.level import level_of
from evertwin.engineering.parts import Component, DataPart, Override, ParameterPart
from evertwin.errors import ConfigError, DataError

KINEMATIC = DataPart("kinematic", "catalogue")
DYNAMIC = DataPart("dynamic", "experiment")


def of(*parts: Component) -> Breakdown:
    return Breakdown("m", system=(System("s", component=parts),))


def test_components_are_ranked_by_effect_times_proneness() -> None:
    found = rank(
        of(Component("a", effect=2, proneness=2), Component("b", effect=5, proneness=2),
           Component("c", effect=3, proneness=5))
    )  # fmt: skip
    assert [(r.component, r.score, r.role) for r in found] == [
        ("c", 15.0, "critical"), ("b", 10.0, "critical"), ("a", 4.0, "supporting"),
    ]  # fmt: skip
    assert "5 × 2 = 10" in found[1].reasons[2]


def test_an_override_goes_before_role_and_score_and_keeps_its_reason() -> None:
    part = Component("a", effect=5, proneness=5, role="critical",
                     override=Override(reason="spare on the shelf", role="supporting"))  # fmt: skip
    (found,) = rank(of(part))
    assert (found.role, found.computed, found.overridden) == (
        "supporting", "critical", "spare on the shelf",
    )  # fmt: skip
    assert "overridden to supporting: spare on the shelf" in found.reasons


def test_a_component_without_grade_needs_a_history() -> None:
    with pytest.raises(ConfigError, match="component 'a': expected proneness = 1 to 5, or a main"):
        rank(of(Component("a")))
    (found,) = rank(of(Component("a", effect=4)), History({"a": (4, 0.0)}, YEAR))
    assert found.proneness == 5.0


@given(st.integers(1, 40), st.floats(0.5, 30.0), st.floats(0.0, 1e6))
def test_more_failures_or_downtime_never_lower_the_grade(n: int, years: float, off: float) -> None:
    one, more = (History({"a": (k, d)}, years * YEAR) for k, d in ((n, off), (n + 1, 2 * off)))
    assert 1.0 <= one.grade("a") <= more.grade("a") <= 5.0


def test_a_history_is_read_with_its_units(tmp_path: Path) -> None:
    path = tmp_path / "h.csv"
    path.write_text("date,component,downtime [min]\n2020-01-01,a,60\n\n2024-01-01,a,30\n")
    found = read_history(path)
    assert found.found["a"] == (2, 5400.0)
    assert found.span == 1461 * 86400.0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "date,part,downtime [h]\n2020-01-01,a,2\n",
            "h.csv:1: expected the columns date, component",
        ),
        (
            "date,component,downtime [h]\n2020-01-01,a,much\n",
            "h.csv:2: downtime: expected a number",
        ),
        ("date,component,downtime [h]\n2020-01-01,a,-2\n", "h.csv:2: downtime: expected 0 or more"),
        ("date,component,downtime [h]\n2020-01-01,a,2\n", "covers 0 days: say how long"),
    ],
)
def test_a_wrong_history_is_told_with_its_line(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "h.csv"
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        read_history(path)
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("part", "role", "level"),
    [
        (Component("a", data=(KINEMATIC, DYNAMIC)), "critical", "white"),
        (Component("a", data=(KINEMATIC, DYNAMIC)), "supporting", "grey"),
        (Component("a", data=(KINEMATIC,), physics="friction law"), "critical", "grey"),
        (Component("a", data=(KINEMATIC,)), "critical", "black"),
        (Component("a", physics="friction law"), "supporting", "black"),
        (Component("a", data=(KINEMATIC, DYNAMIC), interest=False), "critical", "black"),
    ],
)
def test_the_level_follows_from_role_and_data(part: Component, role: str, level: str) -> None:
    assert level_of(part, role).level == level  # type: ignore[arg-type]


def test_missing_data_is_named_with_how_to_get_it() -> None:
    part = Component("a", data=(KINEMATIC,), sensors=("tau1",),
                     parameters={"Fc": ParameterPart(source="experiment")})  # fmt: skip
    found = level_of(part, "critical").missing
    assert [m.kind for m in found] == ["dynamic", "initial value"]
    assert found[0].how.endswith("an experiment seen by tau1")
    assert found[1].what == "initial values of Fc"


def test_an_overridden_level_keeps_what_was_recommended() -> None:
    part = Component("a", data=(KINEMATIC, DYNAMIC), override=Override("later", level="black"))
    found = level_of(part, "critical")
    assert (found.level, found.recommended, found.overridden) == ("black", "white", "later")
