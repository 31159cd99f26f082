"""A TOML text within bounds, its patterns written out, and the line of everything in it.

What comes from a stranger is bounded before it is read: size, depth, length of arrays, digits.

>>> document = Document('name = "axis"\\n["q{1..2}"]\\ncolumn = "{0..1}"', "a.toml")
>>> document.table
{'name': 'axis', 'q1': {'column': 0}, 'q2': {'column': 1}}
>>> document.line(("q2", "column"))
3
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from evertwin.errors import ConfigError
from evertwin.settings.lines import Lines, tokens
from evertwin.settings.notes import Path, PlacedError, dotted
from evertwin.settings.patterns import written_out

LARGEST = 300_000
"""Bytes of the largest text: a recording given by mistake is refused at once."""
DEEPEST = 32
"""Tables and arrays inside one another."""
LONGEST = 10_000
"""Elements of an array, keys of a table."""
DIGITS = 400
"""A longer number is a mistake; the longest double has 309."""
_COMMA = re.compile(r"=\s*[+-]?\d+,\d+\s*(?:#.*)?$")
_TWICE = re.compile(r"Cannot (?:declare|mutate)[^(]*\((.*?),?\) twice")
_PLACE = re.compile(r"^(.*?) \(at (?:line (\d+), column \d+|end of document)\)$")


class Document:
    """The values of a text. See the module for an example.

    Raises:
        ConfigError: it is no TOML, too large, or a pattern does not fit; with name and line.
    """

    def __init__(self, text: str, name: str, title: str = "file of settings") -> None:
        self.text = text
        self.name = name
        if len(text) > LARGEST:
            raise ConfigError(f"{name}: over {LARGEST} characters: expected a {title}")
        self._look()
        try:
            self._table = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            found = _PLACE.match(str(error))
            line = found[2] if found and found[2] else len(text.splitlines())
            said = _cure(text.splitlines()[int(line) - 1 : int(line)], str(error))
            said = said or f"not TOML: {found[1] if found else error}"
            raise ConfigError(f"{name}:{line}: {said}") from error
        try:
            _bounded(self._table, ())
            self.table, self._from = written_out(self._table)
        except PlacedError as error:
            raise ConfigError(f"{name}:{self._lines.of(error.path)}: {error}") from error

    def line(self, path: Path) -> int:
        """The line on which the setting at ``path`` stands, or the nearest table around it."""
        return self._lines.of(self.written(path))

    def written(self, path: Path) -> Path:
        """The setting at ``path`` as the text names it, patterns and all."""
        for length in range(len(path), 0, -1):
            if path[:length] in self._from:
                return (*self._from[path[:length]], *path[length:])
        return path

    def part(self, path: Path) -> Document:
        """What stands at ``path``, as a document of its own with the same lines."""
        return _Part(self, path)

    @cached_property
    def _lines(self) -> Lines:
        return Lines(self.text)

    def _look(self) -> None:
        """Depth and digits, before a parser goes down into them."""
        depth = dots = 0
        for token in tokens(self.text):
            depth += (token.text in ("[", "{")) - (token.text in ("]", "}"))
            dots = dots + 1 if token.text == "." else 0 if token.text in "[]{}\n=," else dots
            if depth > DEEPEST or dots > DEEPEST:
                raise ConfigError(
                    f"{self.name}:{token.line}: expected at most {DEEPEST} tables and arrays "
                    "inside one another, got more"
                )
            if len(token.text) > DIGITS and token.text[0] in "+-0123456789":
                raise ConfigError(
                    f"{self.name}:{token.line}: expected a number of at most {DIGITS} digits, got "
                    f"{len(token.text)} characters"
                )


class Given(Document):
    """A table that was no text: what is wrong with it has a name, and no line.

    >>> Given({"rate": 1.0}, "question").line(("rate",))
    0
    """

    def __init__(self, table: Mapping[str, Any], name: str) -> None:
        self.name, self.table = name, dict(table)
        try:
            _bounded(self.table, ())
        except PlacedError as error:
            raise ConfigError(f"{name}: {error}") from error

    def line(self, path: Path) -> int:
        """None: 0."""
        return 0

    def written(self, path: Path) -> Path:
        """As it is."""
        return path


class _Part(Document):
    """A table of a document."""

    def __init__(self, whole: Document, path: Path) -> None:
        self.name, self._whole, self._path = whole.name, whole, path
        self.table = whole.table
        for key in path:
            self.table = self.table[key]  # type: ignore[index]

    def line(self, path: Path) -> int:
        return self._whole.line((*self._path, *path))

    def written(self, path: Path) -> Path:
        return path


def _bounded(node: Any, path: Path) -> None:
    if isinstance(node, Mapping | list):
        if len(path) > DEEPEST:
            raise PlacedError(f"expected at most {DEEPEST} tables inside one another", path)
        if len(node) > LONGEST:
            kind = "elements" if isinstance(node, list) else "keys"
            said = f"expected at most {LONGEST} {kind}, got {len(node)}"
            raise PlacedError(f"{dotted(path)}: {said}", path)
        for key, item in node.items() if isinstance(node, Mapping) else enumerate(node):
            _bounded(item, (*path, key))
    elif isinstance(node, int) and not -(2**63) <= node < 2**63:
        raise PlacedError(f"{dotted(path)}: expected a whole number of 64 bits, got more", path)
    elif node != node:
        raise PlacedError(f"{dotted(path)}: expected a number, got nan", path)


def _cure(line: list[str], error: str) -> str:
    """What to do about a line that is no TOML, where that can be told.

    >>> _cure(["requirement = 0,05"], ""), _cure([], "Cannot declare ('clock',) twice")
    ('a decimal comma: write a point', "section 'clock' stands twice: write all its keys in one")
    """
    if line and _COMMA.search(line[0]):
        return "a decimal comma: write a point"
    twice = _TWICE.match(error)
    return f"section {twice[1]} stands twice: write all its keys in one" if twice else ""
