"""The JSON schema of a file, for editors: pydantic makes it of the same classes that read it.

An editor that knows TOML schemas completes keys and marks mistakes while typing.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Pump(Section):
...     name: str
...     schema: int = 2
...     speed: float = 1.0
>>> content = schema(Form(Pump, 2, "pump file"))
>>> content["required"], content["properties"]["speed"]["default"]
(['schema', 'name'], 1.0)
"""

from __future__ import annotations

import math
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from evertwin.fold.span import Span
from evertwin.settings.decode import adapter
from evertwin.settings.form import Form
from evertwin.settings.section import Section

_PATTERN = {
    "type": "string",
    "pattern": r"\{.+(,|\.\.).+\}",
    "description": "A pattern such as `{1..6}` or `{a, b, c}`, in step with that of its entry.",
}


class _Plain(GenerateJsonSchema):
    """Without titles and without ``null`` (TOML has none); defaults as they would be written."""

    def field_title_should_be_set(self, schema: object) -> bool:
        return False

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        default, inner = schema.get("default"), self.generate_inner(schema["schema"])
        if isinstance(default, Span):
            default = default.rows if default.seconds is None else str(default)
        if default in (None, ()) or isinstance(default, Section):
            return inner
        if isinstance(default, float) and math.isinf(default):
            return {**inner, "x-default": str(default)}  # JSON has no word for it
        return {**inner, "default": list(default) if isinstance(default, tuple) else default}

    def sort(self, value: JsonSchemaValue, parent_key: str | None = None) -> JsonSchemaValue:
        return value


def schema(form: Form[Any]) -> dict[str, Any]:
    """The schema (draft 2020-12) of a kind of file, as plain values."""
    found: dict[str, Any] = _patterned(content(form))
    return {**found, "$defs": {**found.get("$defs", {}), "Pattern": _PATTERN}}


def _patterned(node: Any) -> Any:
    """With a pattern wherever a number or a word is."""
    if isinstance(node, list):
        return [_patterned(item) for item in node]
    if not isinstance(node, dict):
        return node
    inner = {key: _patterned(item) for key, item in node.items()}
    if "enum" not in node and node.get("type") not in ("integer", "number"):
        return inner
    about = {key: inner.pop(key) for key in ("default", "description") if key in inner}
    return {"anyOf": [inner, {"$ref": "#/$defs/Pattern"}], **about}


def content(form: Form[Any]) -> dict[str, Any]:
    """The schema of what is read when patterns are written out."""
    body = adapter(form.root).json_schema(schema_generator=_Plain)
    version = {"const": form.version, "description": "Version of the file's form."}
    body["properties"]["schema"] = version
    body["required"] = ["schema", *(key for key in body.get("required", ()) if key != "schema")]
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": f"evertwin {form.title}"}
    return head | body
