"""Patterns: what they stand for, and what is said about those that do not fit."""

from __future__ import annotations

import re

import pytest

from evertwin.config import reads
from evertwin.errors import ConfigError
from evertwin.settings.document import Document

HEAD = 'schema = 1\nname = "axis"\nmodel = { kind = "drive" }\n'


def table(text: str) -> object:
    return Document(text, "f").table


CASES = {
    "key and text go along": (
        '"q{1..3}" = { column = "position.{0..2}", unit = "rad" }',
        {f"q{k + 1}": {"column": f"position.{k}", "unit": "rad"} for k in range(3)},
    ),
    "numbers": (
        '"tau{1..2}" = { column = "{13..14}", scale = "{14.87, -1e1}" }',
        {"tau1": {"column": 13, "scale": 14.87}, "tau2": {"column": 14, "scale": -10.0}},
    ),
    "words": ('"{x, y}" = "p{x, y}"', {"x": "px", "y": "py"}),
    "downwards": ('"a{3..1}" = 0', {"a3": 0, "a2": 0, "a1": 0}),
    "leading noughts": ('"a{08..10}" = "{08..10}"', {"a08": "08", "a09": "09", "a10": 10}),
    "twice in one text": ('"a{1..2}" = "b{1..2}c{3..4}"', {"a1": "b1c3", "a2": "b2c4"}),
    "elements": ('a = ["b", "q{1..2}", "c"]', {"a": ["b", "q1", "q2", "c"]}),
    "tables of an array": (
        '[[d]]\nname = "qdd{1..2}"\nfrom = ["qd{1..2}"]',
        {"d": [{"name": f"qdd{k}", "from": [f"qd{k}"]} for k in (1, 2)]},
    ),
    "an array in a table of an array": (
        '[[d]]\nname = "sum"\nfrom = ["qd{1..2}"]', {"d": [{"name": "sum", "from": ["qd1", "qd2"]}]}
    ),
    "headings": ('["j{1..2}".limits]\nlow = 1', {f"j{k}": {"limits": {"low": 1}} for k in (1, 2)}),
    "the text itself": ('a = "{{1..6}}"\nb = "{{a,b}}"', {"a": "{1..6}", "b": "{a,b}"}),
    "no pattern": (
        'a = "{component}.{axis}"\nb = "${NAME:-x,y}"\nc = "{}"',
        {"a": "{component}.{axis}", "b": "${NAME:-x,y}", "c": "{}"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_a_pattern_stands_for(case: str) -> None:
    text, expected = CASES[case]
    assert table(text) == expected


def test_the_order_is_that_of_the_file() -> None:
    text = 'z = 1\n"q{1..2}" = 1\na = 1\n"{c, b}" = 1'
    assert list(Document(text, "f").table) == ["z", "q1", "q2", "a", "c", "b"]


WRONG = {
    "lengths": (
        '\n"q{1..6}" = { column = "position.{0..4}" }',
        "f:2: 'position.{0..4}' has 5 members, 'q{1..6}' has 6: the patterns of an entry go along",
    ),
    "lengths in an array": (
        '[[d]]\nname = "a{1..2}"\n\nfrom = [\n"x",\n"b{1..3}"]', "f:6: 'b{1..3}' has 3 members",
    ),
    "twice": ("q1 = 0\n'q{1..2}' = 1", "f:2: 'q{1..2}' gives 'q1' a second time"),
    "alone": ('[a]\nname = "b{1..2}"', "f:2: 'b{1..2}': a pattern in a text needs one in its key"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_fit_is_told_with_its_line(case: str) -> None:
    text, message = WRONG[case]
    with pytest.raises(ConfigError, match=f"^{re.escape(message)}"):
        table(text)


def test_a_mistake_behind_a_pattern_is_told_once_at_its_line() -> None:
    text = HEAD + '[[source]]\nname = "a"\n[source.channels]\n"q{1..2}" = { column = "{0..1}" }\n'
    text += '[[derive]]\nname = "v{1..2}"\nop = "derivative"\nfrm = ["q{1..2}"]\n'
    with pytest.raises(ConfigError) as error:
        reads(text, "f")
    assert str(error.value).splitlines() == [
        "f:7: [source[0].channels.q1] needs 'unit': Unit in the file; \"1\" for a pure number.",
        "f:8: [derive[0]] needs 'from': Recorded or derived channels it is computed from.",
        "f:11: [derive[0]] unknown key 'frm', did you mean 'from'?",
    ]
