"""On which line of a TOML text a key stands: the standard parser does not say.

One pass over the tokens of a text that is known to be valid: headings open tables, keys of inline
tables and elements of arrays are found where they stand.

>>> lines = Lines("schema = 1\\n[[source]]\\nname = 1\\nfiles = [\\n 'x',\\n]\\n[clock]\\nrate = 1")
>>> [lines.of(path) for path in (("source", 0, "files", 0), ("clock", "rate"), ("clock", "gap"))]
[5, 8, 7]
"""

from __future__ import annotations

import re
import tomllib
from typing import NamedTuple

from evertwin.settings.notes import Path

_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}'
    r"|'''.*?'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
    r"|\#[^\n]*"
    r"|[\[\]{}\n=,.]"
    r"|[^\[\]{}\n=,.\"'\#\s]+"
    r"|.",
    re.DOTALL,
)


class Token(NamedTuple):
    """A sign, a quoted text, or a run of anything else.

    >>> [token.text for token in tokens("a = '[' # b")]
    ['a', '=', "'['"]
    """

    text: str
    line: int


def tokens(text: str) -> list[Token]:
    """The tokens of a TOML text, without blanks and comments; every text has some."""
    found, line = [], 1
    for match in _TOKEN.finditer(text):
        part = match[0]
        if part == "\n" or not (part.isspace() or part[0] == "#"):
            found.append(Token(part, line))
        line += part.count("\n")
    return found


class Lines:
    """Line numbers of the keys of a valid TOML text.

    >>> Lines("a = 1").of(("a",))
    1
    """

    def __init__(self, text: str) -> None:
        self._found: dict[Path, int] = {(): 1}
        self._counts: dict[Path, int] = {}
        self._left = [Token("\n", 0), *reversed(tokens(text))]
        table: Path = ()
        while len(self._left) > 1:
            token = self._left[-1]
            if token.text == "\n":
                self._left.pop()
            elif token.text == "[":
                table = self._heading(token.line)
            else:
                self._pair(table)

    def of(self, path: Path) -> int:
        """The line of ``path``, or of the nearest table around it."""
        while path not in self._found:
            path = path[:-1]
        return self._found[path]

    def _heading(self, line: int) -> Path:
        self._left.pop()
        array = self._left[-1].text == "["
        if array:
            self._left.pop()
        path: Path = ()
        names = self._key()
        for depth, name in enumerate(names):
            path = (*path, name)
            self._found.setdefault(path, line)
            if array and depth == len(names) - 1:
                self._counts[path] = self._counts.get(path, -1) + 1
            if path in self._counts:
                path = (*path, self._counts[path])
        self._found[path] = line
        while self._left[-1].text == "]":
            self._left.pop()
        return path

    def _pair(self, table: Path) -> None:
        """``key = value``; the key is below ``table``."""
        line, path = self._left[-1].line, table
        for name in self._key():
            path = (*path, name)
            self._found.setdefault(path, line)
        self._left.pop()
        self._value(path)

    def _key(self) -> Path:
        names = [_name(self._left.pop().text)]
        while self._left[-1].text == ".":
            self._left.pop()
            names.append(_name(self._left.pop().text))
        return tuple(names)

    def _value(self, path: Path) -> None:
        opening = self._left[-1].text
        if opening not in ("[", "{"):
            while self._left[-1].text not in (",", "]", "}", "\n"):
                self._left.pop()
            return
        self._left.pop()
        count = 0
        while (token := self._left[-1]).text not in ("]", "}"):
            if token.text in ("\n", ","):
                self._left.pop()
            elif opening == "{":
                self._pair(path)
            else:
                self._found[(*path, count)] = token.line
                self._value((*path, count))
                count += 1
        self._left.pop()


def _name(text: str) -> str:
    """A key without its quotes."""
    return str(tomllib.loads(f"x = {text}")["x"]) if text[0] in "\"'" else text
