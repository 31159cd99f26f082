"""The reference page of a file, from the same classes that read it.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Pump(Section):
...     speed: float = 1.0
>>> "| `speed` | number | `1.0` |" in page(Pump, "# The pump file")
True
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin

from evertwin.settings.fields import (
    Free,
    Limits,
    Quantity,
    Section,
    Setting,
    field_docs,
    last,
    options,
    section_doc,
    settings,
    split,
)
from evertwin.settings.schema import sections

__all__ = ["page"]

_WORDS = {str: "text", int: "whole number", float: "number", bool: "true or false"}


def page(root: type[Section], opening: str) -> str:
    """Markdown: the opening, then one table for each section of the file ``root``."""
    parts = [opening]
    for kind in sections(root):
        title = "The whole file" if kind is root else section_doc(kind).split(":")[0]
        title = title.replace("``", "`")
        about = "" if kind is root else section_doc(kind).partition(": ")[2]
        parts.append(f"## {title}\n\n{about[:1].upper() + about[1:]}\n\n{_table(kind)}")
    return "\n\n".join(parts) + "\n"


def _table(kind: type[Section]) -> str:
    docs = field_docs(kind)
    rows = [
        f"| `{s.key}` | {_kind(s.type, s.notes)} | {_default(s)} | {_cell(docs.get(s.name, ''))} |"
        for s in settings(kind)
    ]
    return "\n".join(["| key | value | default | meaning |", "|---|---|---|---|", *rows])


def _cell(text: str) -> str:
    return " ".join(inspect.cleandoc(text).split()).replace("``", "`").replace("|", "\\|")


def _default(setting: Setting) -> str:
    value = setting.default
    if setting.required:
        return "**needed**"
    if value is None or value in ((), {}) or isinstance(value, Section | Mapping):
        return "absent"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _kind(hint: Any, notes: tuple[object, ...]) -> str:
    if last(Free, notes):
        return "table"
    members = [split(m) for m in options(hint) if m is not type(None)]
    if len(members) > 1:
        return " or ".join(_kind(kind, (*notes, *more)) for kind, more in members)
    kind, more = members[0]
    notes = (*notes, *more)
    origin = get_origin(kind)
    if origin is Literal:
        return ", ".join(f"`{word}`" for word in get_args(kind))
    if origin is tuple:
        return f"array of {_kind(*split(get_args(kind)[0]))}"
    if origin is not None:
        return f"table: name = {_kind(*split(get_args(kind)[1]))}"
    if isinstance(kind, type) and issubclass(kind, Section):
        return "section"
    return _number(kind, notes)


def _number(kind: Any, notes: tuple[object, ...]) -> str:
    quantity, limits = last(Quantity, notes), str(last(Limits, notes) or "")
    word = _WORDS[kind]
    if quantity is not None:
        word = f"quantity in {quantity.unit}" if quantity.unit else "quantity"
    return f"{word}, {limits}" if limits else word
