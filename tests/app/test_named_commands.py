"""What messages and documents tell people to type exists: every command, and every option of it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import typer.main

import evertwin
from evertwin.app.cli import app

ROOT = Path(evertwin.__file__).parent
PROSE = frozenset({
    "again", "can", "import", "in", "itself", "keeps", "log", "on", "reads", "runs", "says",
})  # fmt: skip
"""What else stands behind the name."""
OTHERS = frozenset({"--compression-mode", "--csv", "--data-checksums", "--line-blue"})
"""Options of other programs, and names of colours."""
NAMED = re.compile(r"\bevertwin((?: [a-z][a-z-]*)+)((?: [^'`\n]*)?)")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")


@cache
def commands() -> dict[str, frozenset[str]]:
    """Command, with its group, to its options."""
    found = dict[str, frozenset[str]]()

    def down(command: Any, path: tuple[str, ...]) -> None:
        found[" ".join(path)] = frozenset(
            option for one in command.params for option in (*one.opts, *one.secondary_opts)
        )
        for name, inner in getattr(command, "commands", {}).items():
            down(inner, (*path, name))

    down(typer.main.get_command(app), ())
    return found


def texts(file: Path) -> Iterator[tuple[int, str]]:
    """Literals with their lines, docstrings too; of an f-string what stands between the values."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.JoinedStr):
            parts = (p.value if isinstance(p, ast.Constant) else "X" for p in node.values)
            yield node.lineno, "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


@cache
def of_worlds() -> frozenset[str]:
    """Options of the simulated machines, which are programs of their own."""
    every = (text for file in (ROOT / "worlds").rglob("*.py") for _, text in texts(file))
    return frozenset(text for text in every if OPTION.fullmatch(text))


def wrong(text: str) -> Iterator[str]:
    """What a text names that does not exist."""
    every = frozenset().union(*commands().values()) | of_worlds() | OTHERS | {"--help"}
    for words, rest in NAMED.findall(text):
        first, *more = words.split()
        if first in PROSE:
            continue
        if first not in commands():
            yield f"evertwin {first}"
            continue
        group = any(name.startswith(f"{first} ") for name in commands())
        name = f"{first} {more[0]}" if group and more else first
        if name not in commands():
            yield f"evertwin {name}"
            continue
        own = commands()[name] | {"--help"}
        yield from (f"evertwin {name} {o}" for o in OPTION.findall(rest) if o not in own)
    yield from (o for o in OPTION.findall(text) if o not in every)


def test_every_command_and_option_of_a_message_exists() -> None:
    found = {
        f"{file.relative_to(ROOT)}:{line}: {name}"
        for file in sorted(ROOT.rglob("*.py"))
        for line, text in texts(file)
        for name in wrong(text)
    }
    assert not found, sorted(found)


def test_what_does_not_exist_is_found() -> None:
    assert list(wrong("look at it with 'evertwin inspect'")) == ["evertwin inspect"]
    assert list(wrong("say evertwin store mend X")) == ["evertwin store mend"]
    assert list(wrong("evertwin info X --jsn")) == ["evertwin info --jsn", "--jsn"]
    assert list(wrong("evertwin info X --json, as evertwin reads it")) == []
