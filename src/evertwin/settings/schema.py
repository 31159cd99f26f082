"""The JSON schema of a file, for editors: from the same classes that read it.

An editor that knows TOML schemas completes keys and marks mistakes while typing.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Pump(Section):
...     name: str
...     speed: float = 1.0
>>> content = schema(Pump, 2, "pump file")
>>> content["required"], content["properties"]["speed"]["default"]
(['schema', 'name'], 1.0)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin

from evertwin.settings.fields import (
    Free,
    Inherit,
    Limits,
    Quantity,
    Section,
    Setting,
    Shorthand,
    field_docs,
    last,
    options,
    section_doc,
    settings,
    split,
)
from evertwin.types import Json

__all__ = ["schema", "sections"]

_WORDS = {str: "string", int: "integer", float: "number", bool: "boolean"}
_LIMITS = {
    "above": "exclusiveMinimum",
    "at_least": "minimum",
    "at_most": "maximum",
    "below": "exclusiveMaximum",
}


def schema(root: type[Section], version: int, title: str) -> Mapping[str, Json]:
    """The schema (draft 2020-12), as plain values.

    Args:
        root: the class of the whole file.
        version: what the file's key ``schema`` must say.
        title: what the file is called.
    """
    body: dict[str, Any] = _section(root)
    body["properties"]["schema"] = {
        "const": version,
        "description": "Version of the file's form.",
    }
    body["required"] = ["schema", *(key for key in body["required"] if key != "schema")]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        **body,
        "$defs": {kind.__name__: _definition(kind) for kind in sections(root) if kind is not root},
    }


def sections(root: type[Section]) -> tuple[type[Section], ...]:
    """Every section that a file can hold, the whole file first."""
    found: list[type[Section]] = []

    def visit(kind: type[Section]) -> None:
        if kind not in found:
            found.append(kind)
            for setting in settings(kind):
                for inner in _inner(setting.type):
                    visit(inner)

    visit(root)
    return tuple(found)


def _inner(hint: Any) -> list[type[Section]]:
    kind, _ = split(hint)
    if isinstance(kind, type) and not get_args(kind):
        return [kind] if issubclass(kind, Section) else []
    return [found for part in get_args(kind) for found in _inner(part)]


def _definition(kind: type[Section]) -> dict[str, Any]:
    table = _section(kind)
    short = getattr(kind, "shorthand", None)
    if not isinstance(short, Shorthand):
        return table
    (setting,) = (s for s in settings(kind) if s.key == short.key)
    return {"anyOf": [table, _type(setting.type, setting.notes)]}


def _section(kind: type[Section]) -> dict[str, Any]:
    docs = field_docs(kind)
    return {
        "type": "object",
        "description": section_doc(kind),
        "properties": {s.key: _property(s, docs.get(s.name, "")) for s in settings(kind)},
        "required": [s.key for s in settings(kind) if s.required],
        "additionalProperties": False,
    }


def _property(setting: Setting, doc: str) -> dict[str, Any]:
    found = {"type": "object"} if setting.has(Free) else _type(setting.type, setting.notes)
    text = {"description": " ".join(doc.split())} if doc else {}
    default = setting.default
    plain = isinstance(default, bool | int | float | str) and default not in (math.inf, -math.inf)
    return {**found, **text, **({"default": default} if plain else {})}


def _type(hint: Any, notes: tuple[object, ...]) -> dict[str, Any]:
    members = [split(m) for m in options(hint) if m is not type(None)]
    if len(members) > 1:
        return {"anyOf": [_type(kind, (*notes, *more)) for kind, more in members]}
    kind, more = members[0]
    notes = (*notes, *more)
    origin = get_origin(kind)
    if origin is tuple:
        return {"type": "array", "items": _type(*split(get_args(kind)[0]))}
    if origin is Literal:
        return {"enum": list(get_args(kind))}
    if isinstance(kind, type) and issubclass(kind, Section):
        return {"$ref": f"#/$defs/{kind.__name__}"}
    if origin is not None:
        inner = _type(*split(get_args(kind)[1]))
        if last(Inherit, notes):
            inner = {"$ref": inner["$ref"]}
        return {"type": "object", "additionalProperties": inner}
    return _scalar(kind, notes)


def _scalar(kind: Any, notes: tuple[object, ...]) -> dict[str, Any]:
    limits = last(Limits, notes) or Limits()
    given = {word: getattr(limits, name) for name, word in _LIMITS.items()}
    bounds = {word: value for word, value in given.items() if value is not None}
    plain = {"type": _WORDS[kind], **bounds}
    if last(Quantity, notes) is None:
        return plain
    return {"anyOf": [plain, {"type": "string", "pattern": r"^\s*([+-]?[\d.]|[+-]?inf)"}]}
