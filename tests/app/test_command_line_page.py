"""The page of the command line names every command and every option that there is."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer.main

from evertwin.app.cli import app

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "command-line.md"
EVERYWHERE = {"--help", "--json"}
"""Told once, above the table."""


@cache
def commands() -> dict[str, Any]:
    """Every command by its words."""
    found: dict[str, Any] = {}

    def walk(command: Any, words: str) -> None:
        inner = getattr(command, "commands", None)
        if inner is None:
            found[words] = command
        for name, one in (inner or {}).items():
            walk(one, f"{words} {name}")

    walk(typer.main.get_command(app), "evertwin")
    return found


@cache
def rows() -> dict[str, str]:
    """The page's table: words of a command → its row."""
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines()
             if line.startswith("| `evertwin")]  # fmt: skip
    known = sorted(commands(), key=len, reverse=True)
    return {next(name for name in known if f"`{name}" in line): line for line in lines}


def test_the_page_lists_every_command() -> None:
    assert len(commands()) > 20 and set(rows()) == set(commands())


@pytest.mark.parametrize("name", sorted(commands()))
def test_the_row_of_a_command_lists_its_options(name: str) -> None:
    told = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", rows()[name].replace("`", " ")))
    options = [p for p in commands()[name].params if p.param_type_name == "option"]
    there = [{*p.opts, *p.secondary_opts} for p in options if not EVERYWHERE & {*p.opts}]
    assert not [sorted(one) for one in there if not one & told], "options that the page lacks"
    assert told <= set().union(*there, EVERYWHERE), "options that do not exist"
