"""From the values of a document to checked sections: pydantic reads, a problem becomes one line.

A line says where, what was expected and what came; for an unknown key the nearest one.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Clock(Section):
...     rate: float = 1.0
>>> decode(Clock, Document("rate = 5", "a.toml"))
Clock(rate=5.0)
>>> decode(Clock, Document("rates = 5", "a.toml"))
Traceback (most recent call last):
evertwin.errors.ConfigError: a.toml:1: unknown key 'rates', did you mean 'rate'?
"""

from __future__ import annotations

import difflib
from functools import cache
from typing import Any, TypeVar, get_args

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from evertwin.errors import ConfigError, nearest
from evertwin.settings.document import Document
from evertwin.settings.notes import Path, dotted
from evertwin.settings.section import Section, field_docs, is_section, setting_at, settings

S = TypeVar("S", bound=Section)
_EXPECTED = {
    "bool_type": "true or false",
    "dict_type": "a table",
    "float_type": "a number",
    "int_type": "a whole number",
    "mapping_type": "a table",
    "string_type": "text",
    "tuple_type": "an array such as ['a', 'b']",
}
"""What pydantic's kinds of error expect; its own words for any other."""
_BOUNDS = {"greater_than", "greater_than_equal", "less_than", "less_than_equal"}


def adapter(root: type[S]) -> TypeAdapter[S]:
    """What reads a file of this kind; made once."""
    kind: type = root
    return _adapter(kind)


@cache
def _adapter(root: type) -> TypeAdapter[Any]:
    return TypeAdapter(root)


def decode(root: type[S], document: Document) -> S:
    """The sections of a document.

    Args:
        root: the class of the whole file.
        document: its values, and where they stand.

    Raises:
        ConfigError: with one line for each problem, ``name:line: what was expected, what came``.
    """
    table = document.table
    try:
        return adapter(root).validate_python(table)
    except ValidationError as error:
        every = error.errors(include_url=False)
    found: dict[tuple[Path, str], tuple[int, str]] = {}
    for one in every:
        context = one.get("ctx", {})
        at = root.written(table, (*one["loc"], *context.get("path", ())))
        said = _said(root, one, root.written(table, one["loc"]), context)
        # what a pattern repeats is told once
        found.setdefault((document.written(at), one["type"]), (document.line(at), said))
    lines = (f"{document.name}:{line}: {said}" for line, said in sorted(found.values()))
    raise ConfigError("\n".join(dict.fromkeys(lines)))


def _said(root: type[Section], one: ErrorDetails, path: Path, context: dict[str, Any]) -> str:
    """The problem in words, after its place."""
    kind, inside = one["type"], f"[{dotted(path[:-1])}] " if len(path) > 1 else ""
    if kind == "unexpected_keyword_argument":
        names = [setting.key for setting in settings(setting_at(root, one["loc"][:-1]).type)]
        return f"{inside}unknown key '{path[-1]}', {nearest(path[-1], names)}"
    if kind == "missing":
        name = setting_at(root, one["loc"]).name
        doc = field_docs(setting_at(root, one["loc"][:-1]).type).get(name, "").split("\n")[0]
        return f"{inside}needs '{path[-1]}': {doc}"
    if kind == "said":
        return f"{dotted(path)}: {context['said']}" if path else str(context["said"])
    said = f"expected {_expected(root, one)}, got {_shown(one['input'])}"
    said += ": a question that was left open, answer it" if one["input"] == "?" else ""
    if kind == "literal_error":
        said += _near(one["input"], get_args(setting_at(root, one["loc"]).type))
    return f"{dotted(path)}: {said}"


def _expected(root: type[Section], one: ErrorDetails) -> str:
    kind = one["type"]
    if kind in _BOUNDS:
        return setting_at(root, one["loc"]).range
    hint = setting_at(root, one["loc"]).type
    if kind == "tuple_type" and is_section(get_args(hint)[0]):
        return f"an array of tables, [[{one['loc'][-1]}]]"
    if kind == "literal_error":
        words = get_args(hint)
        return "one of " + ", ".join(f"'{word}'" for word in words)
    return _EXPECTED.get(kind, one["msg"])


def _near(value: object, words: tuple[str, ...]) -> str:
    near = difflib.get_close_matches(str(value), words, n=1)
    return f", did you mean '{near[0]}'?" if near else ""


def _shown(value: object) -> str:
    shown = str(value).lower() if isinstance(value, bool) else repr(value)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
