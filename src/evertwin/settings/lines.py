"""On which line of a TOML text a key stands: the standard parser does not say.

The text is known to be valid when it comes here, so one pass over its lines is enough: headings
open tables, keys end where their value parses.

>>> lines = Lines("schema = 1\\n[[source]]\\nname = 1\\nfiles = [\\n 'x',\\n]\\n[clock]\\nrate = 1")
>>> lines.of(("source", 0, "files")), lines.of(("clock", "rate")), lines.of(("clock", "gap"))
(4, 8, 7)
"""

from __future__ import annotations

import re
import tomllib
from typing import Any, TypeAlias

__all__ = ["Lines", "Path"]

Path: TypeAlias = "tuple[str | int, ...]"
_HEADING = re.compile(r"\s*(\[\[?)(.+?)\]\]?\s*(?:#.*)?$")
_KEY = re.compile(
    r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=(.*)"""
)


class Lines:
    """Line numbers of the keys of a valid TOML text.

    >>> Lines("a = 1").of(("a",))
    1
    """

    def __init__(self, text: str) -> None:
        self._found: dict[Path, int] = {(): 1}
        self._counts: dict[Path, int] = {}
        lines = text.splitlines()
        table: Path = ()
        at = 0
        while at < len(lines):
            heading, key = _HEADING.match(lines[at]), _KEY.match(lines[at])
            if heading and not key:
                table = self._open(_parts(heading[2]), array=heading[1] == "[[")
                self._found[table] = at + 1
            elif key:
                self._found.setdefault(table + _parts(key[1]), at + 1)
                at += _extra_lines(key[2], lines[at + 1 :])
            at += 1

    def of(self, path: Path) -> int:
        """The line of ``path``, or of the nearest table around it."""
        while path not in self._found:
            path = path[:-1]
        return self._found[path]

    def _open(self, names: Path, *, array: bool) -> Path:
        path: Path = ()
        for depth, name in enumerate(names):
            path = (*path, name)
            if array and depth == len(names) - 1:
                self._counts[path] = self._counts.get(path, -1) + 1
            if path in self._counts:
                path = (*path, self._counts[path])
        return path


def _parts(dotted: str) -> Path:
    value: Any = tomllib.loads(f"{dotted} = 0")
    names: list[str] = []
    while isinstance(value, dict):
        (name,) = value
        names.append(name)
        value = value[name]
    return tuple(names)


def _extra_lines(value: str, rest: list[str]) -> int:
    """How many lines after the first the value takes."""
    for extra in range(len(rest) + 1):
        try:
            tomllib.loads("x =" + "\n".join([value, *rest[:extra]]))
        except tomllib.TOMLDecodeError:
            continue
        return extra
    return 0
