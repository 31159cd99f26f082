"""The reference page of a file, from its JSON schema."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

from evertwin.settings.form import Form
from evertwin.settings.schema import content

__all__ = ["page"]

Node: TypeAlias = "dict[str, Any]"
_WORDS = {
    "string": "text",
    "integer": "whole number",
    "number": "number",
    "boolean": "true or false",
}
_BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at least",
    "maximum": "at most",
    "exclusiveMaximum": "below",
}


def page(form: Form[Any]) -> str:
    """Markdown: what the file is, then one table for each section."""
    whole = content(form)
    parts = [form.about, f"## The whole file\n\n{_table(whole)}"]
    for name in dict.fromkeys(_references(whole, whole.get("$defs", {}))):
        section = whole["$defs"][name]
        title, _, about = _text(section).partition(": ")
        parts.append(f"## {title}\n\n{about[:1].upper() + about[1:]}\n\n{_table(section)}")
    return "\n\n".join(parts) + "\n"


def _references(node: Any, definitions: Node) -> Iterator[str]:
    """Names of the sections below, each before those that it holds."""
    if isinstance(node, list):
        for item in node:
            yield from _references(item, definitions)
    elif isinstance(node, dict):
        if "$ref" in node:
            name = node["$ref"].rpartition("/")[2]
            yield name
            yield from _references(definitions[name], definitions)
        for key, item in node.items():
            yield from _references(item, definitions) if key != "$defs" else ()


def _table(section: Node) -> str:
    table = section.get("anyOf", [section])[0]
    rows = [
        f"| `{key}` | {_kind(node)} | {_default(key, node, table)} | {_text(node)} |"
        for key, node in table["properties"].items()
    ]
    return "\n".join(["| key | value | default | meaning |", "|---|---|---|---|", *rows])


def _text(node: Node) -> str:
    return str(node.get("description", "")).replace("``", "`").replace("|", "\\|")


def _default(key: str, node: Node, table: Node) -> str:
    if key in table.get("required", ()):
        return "**needed**"
    value = node.get("default", node.get("x-default"))
    if value is None:
        return "absent"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _kind(node: Node) -> str:
    """What may be written, in words."""
    if "$ref" in node:
        return "section"
    if "const" in node:
        return f"`{node['const']}`"
    if "enum" in node:
        return ", ".join(f"`{word}`" for word in node["enum"])
    if "x-unit" in node:
        return _quantity(node)
    if "anyOf" in node:
        return " or ".join(_kind(choice) for choice in node["anyOf"])
    if node.get("type") == "array":
        return f"array of {_kind(node['items'])}"
    inner = node.get("additionalProperties")
    if isinstance(inner, dict):
        return f"table: name = {_kind(inner)}"
    return _bounded(_WORDS.get(node.get("type", ""), "table"), node)


def _quantity(node: Node) -> str:
    plain, unit = node["anyOf"][0], node["x-unit"]
    if plain["type"] == "integer":
        return f"{_bounded('rows', plain)}, or a time"
    return _bounded(f"quantity in {unit}" if unit else "quantity", plain | node)


def _bounded(word: str, node: Node) -> str:
    bounds = " and ".join(
        f"{said} {_plain(node[key])}" for key, said in _BOUNDS.items() if key in node
    )
    return f"{word}, {bounds}" if bounds else word


def _plain(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"
