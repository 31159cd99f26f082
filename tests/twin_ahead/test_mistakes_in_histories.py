"""Mistakes in histories and scenarios: each is refused with its line."""

from __future__ import annotations

import pytest

from evertwin.config.scenario import SCENARIO
from evertwin.errors import ConfigError, DataError
from evertwin.twin.ahead.table import parse


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("run,Fc\n1,2\n2,abc", "h.csv:3: Fc: expected a number or a date, got 'abc'"),
        ("run,Fc\n\n1,2\n2,3 Nm", "h.csv:4: Fc: expected a number or a date, got '3 Nm'"),
        ("run,Fc\n1,2024-01-01\n2,3", "h.csv:2: Fc: expected numbers or dates alone, got both"),
        ("run,Fc\n1,2\n2,inf", "h.csv:3: Fc: expected a finite number"),
        ("run;Fc\n1;2", "h.csv:1: expected commas between cells"),
        ("run,Fc\n1", "h.csv:2: expected 2 cells, got 1"),
    ],
)
def test_a_bad_cell_is_named_with_its_line(text: str, said: str) -> None:
    with pytest.raises(DataError) as caught:
        parse(text.splitlines(), "h.csv").column("Fc")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("wear = -5", "s.toml:3: wear: expected a number above 0"),
        ('[limits]\ntau2 = "-3 Nm"', "s.toml:4: limits.tau2: expected a number above 0"),
        ('[path]\nmoves = "line"', "s.toml:3: path: moves: expected a list of tables"),
    ],
)
def test_a_bad_scenario_is_refused_with_its_line(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        SCENARIO.parse(f'schema = 1\nname = "s"\n{text}', "s.toml")
    assert said in str(caught.value)
