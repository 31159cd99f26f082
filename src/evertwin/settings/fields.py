"""What a setting may be, said once in its annotation.

A section of the twin file is a frozen dataclass. A field's type, its `Annotated` notes and the text
under it are all there is: reading, checking, the JSON schema and the reference page follow from
them, so they cannot disagree.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Clock(Section):
...     rate: Annotated[float | None, Quantity("Hz"), Limits(above=0.0)] = None
>>> [(f.key, f.required, str(f.limits)) for f in settings(Clock)]
[('rate', False, 'above 0')]
>>> Clock(rate=-1.0)
Traceback (most recent call last):
evertwin.errors.UsageError: rate: expected a number above 0, got -1.0
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import textwrap
import types
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from evertwin.errors import UsageError
from evertwin.settings.lines import Path

__all__ = [
    "Free",
    "Hidden",
    "Inherit",
    "Key",
    "Late",
    "Limits",
    "PlacedError",
    "Quantity",
    "Section",
    "Setting",
    "Shorthand",
    "field_docs",
    "last",
    "options",
    "section_doc",
    "settings",
    "split",
]


Note = TypeVar("Note")


class Quantity(NamedTuple):
    """Marks a number that may be written with a unit; its value is always SI.

    >>> Quantity("s").unit
    's'
    """

    unit: str = ""
    """What is expected; empty: the unit of the channel or parameter that it is about."""
    difference: bool = False
    """A span or spread: the offset between °C and K does not count."""


@dataclass(frozen=True)
class Limits:
    """The range of a number, in SI.

    >>> Limits(above=0.0, at_most=1.0).hold(0.0), str(Limits(above=0.0, at_most=1.0))
    (False, 'above 0 and at most 1')
    """

    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    below: float | None = None

    def hold(self, value: float) -> bool:
        """True if ``value`` is inside; NaN never is."""
        return value == value and (
            (self.above is None or value > self.above)
            and (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
            and (self.below is None or value < self.below)
        )

    def __str__(self) -> str:
        given = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        parts = (f"{n.replace('_', ' ')} {v:g}" for n, v in given.items() if v is not None)
        return " and ".join(parts)


@dataclass(frozen=True)
class Key:
    """The key in the file, where it is no name in Python (``from``).

    >>> Key("from").key
    'from'
    """

    key: str


@dataclass(frozen=True)
class Late:
    """``${NAME}`` is replaced when the value is used, not when the file is read.

    >>> Late() == Late()
    True
    """


@dataclass(frozen=True)
class Free:
    """Values whose meaning is another's: kept as written, quantities turned into SI numbers.

    >>> Free() == Free()
    True
    """

    raw: bool = False
    """Kept word by word: quantities and ``${NAME}`` too."""


@dataclass(frozen=True)
class Inherit:
    """Sub-tables say only what differs from the table around them.

    >>> Inherit() == Inherit()
    True
    """


@dataclass(frozen=True)
class Hidden:
    """Not a setting: filled by the reader.

    >>> Hidden() == Hidden()
    True
    """


@dataclass(frozen=True)
class Shorthand:
    """A section written as one value sets this field: ``time = "t"`` is ``{ column = "t" }``.

    >>> Shorthand("column").key
    'column'
    """

    key: str


@dataclass(frozen=True)
class Section:
    """Base of every section: numbers outside their limits are refused when it is built.

    >>> Section().prepare({"a": 1})
    {'a': 1}
    """

    def __post_init__(self) -> None:
        for setting in settings(type(self)):
            value = getattr(self, setting.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if number and not setting.limits.hold(value):
                expected = f"a number {setting.limits}".rstrip()
                raise UsageError(f"{setting.key}: expected {expected}, got {value}")

    @classmethod
    def prepare(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """The table of the file; a section may fill in what follows from its other keys."""
        return table

    @classmethod
    def written(
        cls, table: Mapping[str, Any], path: tuple[str | int, ...]
    ) -> tuple[str | int, ...]:
        """Where in the file's ``table`` the setting at ``path`` stands, if `prepare` moved it."""
        return path


class PlacedError(UsageError):
    """A mistake somewhere below the section that found it.

    >>> PlacedError("no such sensor", ("sensors", 0)).path
    ('sensors', 0)
    """

    def __init__(self, message: str, path: Path) -> None:
        super().__init__(message)
        self.path = path
        """Where, from the section on."""


@dataclass(frozen=True)
class Setting:
    """One field of a section, as read from its annotation.

    >>> Setting("rate", "rate", float, (Quantity("Hz"),), 1.0, False).quantity.unit
    'Hz'
    """

    name: str
    key: str
    type: Any
    """Without `Annotated`."""
    notes: tuple[object, ...]
    default: Any
    required: bool

    def has(self, note: type) -> bool:
        """True if the annotation carries a note of this kind."""
        return any(isinstance(n, note) for n in self.notes)

    @property
    def quantity(self) -> Quantity | None:
        """The kind of quantity; None for anything else."""
        return last(Quantity, self.notes)

    @property
    def limits(self) -> Limits:
        """The range of a number."""
        return last(Limits, self.notes) or Limits()


def last(kind: type[Note], notes: Sequence[object]) -> Note | None:
    """The outermost note of a kind: it refines what an alias says."""
    return next((n for n in reversed(notes) if isinstance(n, kind)), None)


def settings(section: type) -> tuple[Setting, ...]:
    """The settings of a section in order, without hidden fields."""
    return _settings(section)


@cache
def _settings(section: type) -> tuple[Setting, ...]:
    hints = get_type_hints(section, include_extras=True)
    every = (_setting(field, hints[field.name]) for field in dataclasses.fields(section))
    return tuple(setting for setting in every if not setting.has(Hidden))


def _setting(field: dataclasses.Field[Any], hint: Any) -> Setting:
    kind, notes = split(hint)
    members = options(kind)
    if len(members) == 2 and type(None) in members:  # what is said of X holds for X | None
        (inner,) = (m for m in members if m is not type(None))
        notes = (*notes, *split(inner)[1])
    key = next((n.key for n in notes if isinstance(n, Key)), field.name)
    made = field.default_factory is not dataclasses.MISSING
    required = field.default is dataclasses.MISSING and not made
    default = field.default_factory() if callable(field.default_factory) else field.default
    return Setting(field.name, key, kind, notes, None if required else default, required)


def split(hint: Any) -> tuple[Any, tuple[object, ...]]:
    """The type and the notes of ``Annotated[type, *notes]``."""
    if get_origin(hint) is Annotated:
        kind, *notes = get_args(hint)
        return kind, tuple(notes)
    return hint, ()


def options(hint: Any) -> tuple[Any, ...]:
    """The members of a union, None included; a single type alone."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def field_docs(section: type) -> Mapping[str, str]:
    """The text under each field of a section, as documentation tools read it."""
    return _field_docs(section)


@cache
def _field_docs(section: type) -> Mapping[str, str]:
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
