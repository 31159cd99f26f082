"""Breakdown files: what is read, and what is said about those that are wrong."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import jsonschema
import pytest

from evertwin.engineering.breakdown import BREAKDOWN, read_breakdown
from evertwin.errors import ConfigError
from evertwin.settings.schema import schema

ROOT = Path(__file__).parent.parent.parent
FILES = sorted((ROOT / "twins" / "breakdowns").glob("*.toml"))
HEAD = 'schema = 1\nname = "m"\n[[system]]\nname = "s"\n[[system.component]]\nname = "c"\n'


def test_a_component_says_only_what_differs() -> None:
    text = (
        'schema = 1\nname = "m"\n'
        '[like.box]\nkind = "gearbox"\neffect = 4\n'
        'parameters = { Fc = { value = 1, unit = "Nm", source = "literature" } }\n'
        '[[system]]\nname = "s"\n[[system.subsystem]]\nname = "axis 1"\n'
        '[[system.subsystem.component]]\nname = "g"\nlike = "box"\neffect = 2\n'
        "parameters = { Fc = 7, Fv = 3 }\n"
    )
    part = BREAKDOWN.parse(text).component("g")
    assert (part.kind, part.effect) == ("gearbox", 2)
    assert part.parameters["Fc"].value == 7.0
    assert part.parameters["Fc"].source == "literature"
    assert part.parameters["Fv"].value == 3.0


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ("effekt = 3\n", "m.toml:7: [system[0].component[0]] unknown key"),
        ("effekt = 3\n", "did you mean 'effect'"),
        ("effect = 7\n", "m.toml:7: system[0].component[0].effect: expected a number at least 1"),
        ('level = "white"\n', "unknown key 'level'"),
        ('override = { level = "white" }\n', "needs 'reason': Why"),
        ('override = { level = "gray", reason = "x" }\n', "did you mean 'grey'?"),
        ('wear = [{ effect = "w", parameters = ["Fc"] }]\n', "'c' has no parameter Fc"),
        ('sensors = ["tau1"]\n', "no [sensors.tau1]"),
        ('like = "none"\n', "there is no [like.none]"),
        ('data = [{ kind = "dynamic", from = "hearsay" }]\n', "expected one of 'manual'"),
    ],
)
def test_mistakes_are_told_with_their_line(more: str, expected: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(expected)):
        BREAKDOWN.parse(HEAD + more, "m.toml")


def test_names_are_given_once() -> None:
    with pytest.raises(ConfigError, match="each component's name once, got 'c' twice"):
        BREAKDOWN.parse(HEAD + '[[system.component]]\nname = "c"\n', "m.toml")


def test_a_share_is_no_quantity_of_its_parameter() -> None:
    text = HEAD + 'parameters = { J = { value = 2, unit = "kg*cm**2", uncertain = 0.2 } }\n'
    said = BREAKDOWN.parse(text).component("c").parameters["J"]
    assert (said.value, said.uncertain) == (pytest.approx(2e-4), 0.2)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_schema_agrees_with_the_reader(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EVERTWIN_DATA", "data")
    found = read_breakdown(path)
    assert len(found.components) >= 5
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    jsonschema.validate(content, schema(BREAKDOWN))
    content["system"][0]["componet"] = []
    with pytest.raises(jsonschema.ValidationError, match="componet"):
        jsonschema.validate(content, schema(BREAKDOWN))
