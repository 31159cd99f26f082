"""A section of a file: a frozen dataclass whose annotations are all there is.

A field's type, its notes and the text under it are said once; reading, checking, the JSON schema
and the reference page follow from them, so they cannot disagree. pydantic does the reading. Here
stands what a section adds: bounds hold for one built without a file too, ``unit`` is that of the
bare numbers beside it, one value may stand for the section.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Clock(Section):
...     rate: Annotated[float, Quantity("Hz"), Gt(0.0)] | None = None
>>> Clock(rate=-1.0)
Traceback (most recent call last):
evertwin.errors.UsageError: rate: expected a number above 0, got -1.0
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import operator
import textwrap
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from annotated_types import Ge, Gt, Le, Lt
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from evertwin.errors import UsageError
from evertwin.settings.notes import Hidden, Inherit, Key, Path, Quantity, Shorthand, expand, told

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue

Note = TypeVar("Note")
_BOUNDS: dict[type, tuple[str, Callable[[float, float], bool]]] = {
    Gt: ("above", operator.gt),
    Ge: ("at least", operator.ge),
    Lt: ("below", operator.lt),
    Le: ("at most", operator.le),
}
_WORDS = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false"}


@dataclass(frozen=True)
class Section:
    """Base of every section. See the module for an example.

    >>> Section().prepare({"a": 1})
    {'a': 1}
    """

    __pydantic_config__ = {"extra": "forbid"}  # noqa: RUF012

    def __post_init__(self) -> None:
        for setting in settings(type(self)):
            value = getattr(self, setting.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if number and not setting.holds(value):
                raise UsageError(f"{setting.key}: expected {setting.range}, got {value}")
            kind = setting.type if dataclasses.is_dataclass(setting.type) else object
            if value is not None and not isinstance(value, cast(type, kind)):
                name = cast(type, kind).__name__
                raise UsageError(f"{setting.key}: expected {name}(…), got {value!r}")

    @classmethod
    def prepare(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """The table of the file; a section may fill in what follows from its other keys."""
        return table

    @classmethod
    def written(cls, table: Mapping[str, Any], path: Path) -> Path:
        """Where in the file's ``table`` the setting at ``path`` stands, if `prepare` moved it."""
        return path

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        inner: dict[str, Any] = dict(handler(source))
        ref = inner.pop("ref")
        known = {setting.name: setting for setting in settings(cls)}
        kept = [f for f in inner["schema"]["fields"] if f["name"] in known]
        for field in kept:
            field["validation_alias"] = known[field["name"]].key
        inner["schema"] = {**inner["schema"], "fields": [_strict(field) for field in kept]}

        def read(value: object, build: core_schema.ValidatorFunctionWrapHandler) -> Any:
            table = _whole(cls, value)
            return told(lambda: build(_with_units(cls, cls.prepare(table))))

        return core_schema.no_info_wrap_validator_function(read, inner, ref=ref)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """With the text under each field, and the value that may stand for the section."""
        place = handler(core)
        content = handler.resolve_ref_schema(place)
        docs = field_docs(cls)
        for setting in settings(cls):
            if text := docs.get(setting.name):
                content["properties"][setting.key]["description"] = " ".join(text.split())
        content["description"] = section_doc(cls)
        content.pop("title", None)
        short = getattr(cls, "shorthand", None)
        if isinstance(short, Shorthand):
            table = dict(content)
            value = {k: v for k, v in table["properties"][short.key].items() if k != "default"}
            content.clear()
            content |= {"description": table["description"], "anyOf": [table, value]}
        return place


def _whole(kind: type[Section], value: object) -> Mapping[str, Any]:
    """The table of a section; of one value that stands for it."""
    short = getattr(kind, "shorthand", None)
    if isinstance(value, Mapping):
        return value
    if isinstance(short, Shorthand):
        return {short.key: value}
    raise PydanticCustomError("expected", "{expected}", {"expected": "a table"})


def _with_units(kind: type[Section], table: Mapping[str, Any]) -> Mapping[str, Any]:
    """Bare numbers with the table's unit; sub-tables that inherit with what they inherit."""
    out, unit = dict(table), table.get("unit")
    for setting in settings(kind):
        value = table.get(setting.key)
        quantity = setting.note(Quantity)
        bare = isinstance(value, int | float) and not isinstance(value, bool)
        # the table's unit is that of what it is about, not of a share or a time beside it
        if bare and isinstance(unit, str) and quantity is not None and not quantity.unit:
            out[setting.key] = f"{value!r} {unit}"
        if setting.note(Inherit) is not None and isinstance(value, Mapping):
            around = {key: item for key, item in table.items() if key != setting.key}
            out[setting.key] = {
                k: {**around, **v} if isinstance(v, Mapping) else v for k, v in value.items()
            }
    return out


def _strict(node: Any) -> Any:
    """A schema of pydantic's in which nothing is taken for something else: 1 is not true."""
    if isinstance(node, list):
        return [_strict(item) for item in node]
    if not isinstance(node, dict):
        return node
    kind, strict = node.get("type"), {k: _strict(item) for k, item in node.items()}
    if kind == "union" and all(choice["type"] in _WORDS for choice in node["choices"]):
        words = " or ".join(_WORDS[choice["type"]] for choice in node["choices"])
        return {**strict, "custom_error_type": "expected", "custom_error_message": words}
    if kind == "literal":  # one of some words
        return core_schema.no_info_before_validator_function(_word, cast(CoreSchema, strict))
    if kind not in _WORDS or "strict" in node:
        return strict
    strict["strict"] = True
    if kind == "str":
        return core_schema.no_info_after_validator_function(_text, cast(CoreSchema, strict))
    return strict


def _text(value: str) -> str:
    return told(lambda: expand(value))


def _word(value: object) -> object:
    return _text(value) if isinstance(value, str) else value


@dataclass(frozen=True)
class Setting:
    """One field of a section, as read from its annotation.

    >>> rate = Setting("rate", "rate", float, (Gt(0.0),), True)
    >>> rate.holds(-1.0), rate.range
    (False, 'a number above 0')
    """

    name: str
    key: str
    type: Any
    """Without `Annotated`."""
    notes: tuple[object, ...]
    required: bool

    def note(self, kind: type[Note]) -> Note | None:
        """The outermost note of a kind: it refines what an alias says."""
        return next((n for n in reversed(self.notes) if isinstance(n, kind)), None)

    def holds(self, value: float) -> bool:
        """True if ``value`` is inside the bounds; NaN never is."""
        return value == value and all(inside(value, limit) for _, inside, limit in self._bounds)

    @property
    def range(self) -> str:
        """The bounds in words."""
        parts = [f"{word} {limit:g}" for word, _, limit in self._bounds]
        return f"a number {' and '.join(parts)}".rstrip()

    @property
    def _bounds(self) -> list[tuple[str, Callable[[float, float], bool], float]]:
        return [
            (*_BOUNDS[type(note)], getattr(note, type(note).__name__.lower()))
            for note in self.notes
            if type(note) in _BOUNDS
        ]


_NOTHING = Setting("", "", None, (), False)


def settings(section: type) -> tuple[Setting, ...]:
    """The settings of a section in order, without hidden fields."""
    return _settings(section)


@cache
def _settings(section: type) -> tuple[Setting, ...]:
    hints = get_type_hints(section, include_extras=True)
    every = (_setting(field, hints[field.name]) for field in dataclasses.fields(section))
    return tuple(setting for setting in every if setting.note(Hidden) is None)


def _setting(field: dataclasses.Field[Any], hint: Any) -> Setting:
    kind, notes = split(hint)
    members = [m for m in _options(kind) if m is not type(None)]
    if len(members) == 1:  # what is said of X holds for X | None
        kind, more = split(members[0])
        notes = (*notes, *more)
    key = next((n.key for n in notes if isinstance(n, Key)), field.name)
    missing = dataclasses.MISSING
    required = field.default is missing and field.default_factory is missing
    return Setting(field.name, key, kind, notes, required)


def split(hint: Any) -> tuple[Any, tuple[object, ...]]:
    """The type and the notes of ``Annotated[type, *notes]``.

    >>> split(Annotated[float, Gt(0.25)])
    (<class 'float'>, (Gt(gt=0.25),))
    """
    if get_origin(hint) is Annotated:
        kind, *notes = get_args(hint)
        return kind, tuple(notes)
    return hint, ()


def _options(hint: Any) -> tuple[Any, ...]:
    """The members of a union, None included; a single type alone."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def is_section(kind: object) -> bool:
    """True for the class of a section."""
    return isinstance(kind, type) and issubclass(kind, Section)


def setting_at(root: type[Section], path: Path) -> Setting:
    """What may stand at ``path`` of a file ``root``; a setting of type None where nothing may."""
    found = Setting("", "", root, (), True)
    for part in path:
        if is_section(found.type):
            of = {setting.key: setting for setting in settings(found.type)}
            found = of.get(str(part), _NOTHING)
        else:
            inner = get_args(found.type) or (None,)
            kind, notes = split(inner[0 if isinstance(part, int) else -1])
            found = Setting("", "", kind, notes, True)
    return found


def field_docs(section: type) -> Mapping[str, str]:
    """The text under each field of a section, as documentation tools read it."""
    return _field_docs(section)


@cache
def _field_docs(section: type) -> Mapping[str, str]:
    docs: dict[str, str] = {}
    for base in reversed(section.__mro__[:-1]):
        docs |= _own_docs(base)
    return docs


def _own_docs(section: type) -> Mapping[str, str]:
    try:
        source = inspect.getsource(section)
    except (OSError, TypeError):
        return {}  # typed in a console: there is no text to read
    (tree,) = ast.parse(textwrap.dedent(source)).body
    docs: dict[str, str] = {}
    name = ""
    for node in tree.body if isinstance(tree, ast.ClassDef) else []:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            name = node.target.id
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and name:
            docs[name] = inspect.cleandoc(str(node.value.value))
            name = ""
        else:
            name = ""
    return docs


def section_doc(section: type) -> str:
    """The first paragraph of a section's docstring."""
    return " ".join(inspect.cleandoc(section.__doc__ or "").split("\n\n")[0].split())
