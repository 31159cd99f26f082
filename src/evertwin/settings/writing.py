"""Settings as TOML text: a value on one line, a table as sections, a file by its template.

>>> inline({"a": 1.5, "b": ["x", True], "c": float("inf")})
'{ a = 1.5, b = ["x", true], c = inf }'
>>> print(sections({"clock": {"rate": 10}, "source": [{"name": "log", "files": ["a.csv"]}]}))
[clock]
rate = 10
<BLANKLINE>
[[source]]
name = "log"
files = ["a.csv"]
<BLANKLINE>
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, Template

WIDTH = 100
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def key(name: str) -> str:
    """A key, in quotes where TOML asks for them.

    >>> key("Fc1"), key("gearbox 1.Fc")
    ('Fc1', '"gearbox 1.Fc"')
    """
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def inline(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{key(name)} = {inline(item)}" for name, item in value.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(inline(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return str(value)
    return json.dumps(str(value), ensure_ascii=False)


def sections(table: Mapping[str, Any], path: str = "") -> str:
    """A table as sections: plain keys first, then ``[tables]`` and ``[[arrays of tables]]``."""
    top = path == ""
    plain = {
        name: item
        for name, item in table.items()
        if not _opens(item) and not (top and isinstance(item, Mapping))
    }
    lines = [f"{key(name)} = {_long(item)}" for name, item in plain.items()]
    text = "\n".join(lines) + "\n" if lines else ""
    for name, item in table.items():
        if name in plain:
            continue
        where = f"{path}.{key(name)}" if path else key(name)
        if isinstance(item, Mapping):
            head = f"[{where}]\n" if not item or any(not _opens(v) for v in item.values()) else ""
            text += f"\n{head}{sections(item, where).lstrip()}" if head else sections(item, where)
        else:
            for one in item:
                text += f"\n[[{where}]]\n{sections(one, where).lstrip()}"
    return text if path else text.lstrip()


def _opens(item: Any) -> bool:
    """Does it stand under a heading of its own?"""
    if isinstance(item, Mapping):
        return len(inline(item)) > WIDTH // 2 or any(_opens(value) for value in item.values())
    return isinstance(item, list) and bool(item) and all(isinstance(i, Mapping) for i in item)


def _long(item: Any) -> str:
    """An array that is too long for a line, one item a line."""
    text = inline(item)
    if len(text) <= WIDTH - 20 or not isinstance(item, list | tuple):
        return text
    return "[\n" + "".join(f"  {inline(value)},\n" for value in item) + "]"


@cache
def template(room: str, name: str, **filters: Callable[..., str]) -> Template:
    """A template of a room for a text of settings, with `inline`, `key` and ``filters``."""
    environment = Environment(
        loader=PackageLoader(f"evertwin.{room}", "templates"), trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters |= {"inline": inline, "key": key, **filters}
    return environment.get_template(name)
