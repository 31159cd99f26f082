"""What may be said of a setting in its annotation, beside its type and its bounds.

Bounds are those of `annotated_types` (``Gt``, ``Ge``, ``Lt``, ``Le``), in SI. How a note changes
what is read, and what the JSON schema says of it, stand with the note.

>>> from typing import Annotated
>>> from annotated_types import Gt
>>> Hertz = Annotated[float, Quantity("Hz"), Gt(0.0)]
>>> Quantity("Hz").si("1 kHz"), Rows(least=2).span("30 s")
(1000.0, Span(rows=None, seconds=30.0))
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, TypeVar

from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from evertwin.errors import UsageError
from evertwin.fold.span import MOST, Span
from evertwin.settings.quantity import Measured, as_number, number, written

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue

T = TypeVar("T")
Path: TypeAlias = "tuple[str | int, ...]"
_NAME = re.compile(r"\$\{([A-Za-z_]\w*)(?::-([^}]*))?\}")
_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "le": "maximum", "lt": "exclusiveMaximum"}
"""A bound after a conversion keeps its Python name in pydantic's schema."""
_NUMBER = r"^\s*([+-]?[\d.]|[+-]?inf|\$\{)"


def dotted(path: Path) -> str:
    """The path as users write it.

    >>> dotted(("source", 0, "name"))
    'source[0].name'
    """
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


class PlacedError(UsageError):
    """A mistake somewhere below the section that found it.

    >>> PlacedError("no such sensor", ("sensors", 0)).path
    ('sensors', 0)
    """

    def __init__(self, message: str, path: Path) -> None:
        super().__init__(message)
        self.path = path
        """Where, from the section on."""


def told(make: Callable[[], T], path: Path = ()) -> T:
    """What ``make`` gives; its error as one that pydantic collects, with its place."""
    try:
        return make()
    except UsageError as error:
        below = error.path if isinstance(error, PlacedError) else ()
        said = {"said": str(error), "path": (*path, *below)}
        raise PydanticCustomError("said", "{said}", said) from error


def _wrong(expected: str) -> PydanticCustomError:
    return PydanticCustomError("expected", "{expected}", {"expected": expected})


def expand(text: str) -> str:
    """``text`` with ``${NAME}`` and ``${NAME:-default}`` replaced from the environment.

    Raises:
        UsageError: a name without a default is not set.

    >>> expand("${EVERTWIN_NOT_SET:-here}/run.csv")
    'here/run.csv'
    """

    def value(found: re.Match[str]) -> str:
        name, default = found[1], found[2]
        if name in os.environ:
            return os.environ[name]
        if default is None:
            raise UsageError(
                f"the environment variable {name} is not set: set it, or write ${{{name}:-default}}"
            )
        return str(default)

    return _NAME.sub(value, text)


class Quantity(NamedTuple):
    """Marks a number that may be written with a unit; its value is always SI.

    >>> Quantity("s").si("1 min"), Quantity("s").si(5)
    (60.0, 5)
    """

    unit: str = ""
    """What is expected; empty: the unit of the channel or parameter that it is about, checked by
    who knows it, so the number remembers how it was written (`Measured`)."""
    difference: bool = False
    """A span or spread: the offset between °C and K does not count."""

    def si(self, value: object) -> int | float:
        """The number of a setting."""
        if isinstance(value, str):
            return told(lambda: number(expand(value), self.unit, difference=self.difference))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _wrong(f"a number or text such as '2 {self.unit or 'cm'}'")
        return value

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        def read(value: object, bounded: core_schema.ValidatorFunctionWrapHandler) -> float:
            size: float = bounded(self.si(value))
            text = expand(value) if isinstance(value, str) else ""
            told = text and not self.unit and written(text)[1]
            return Measured(size, text) if told else size

        return core_schema.no_info_wrap_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        plain = {_BOUNDS.get(word, word): value for word, value in handler(core).items()}
        return {"anyOf": [plain, {"type": "string", "pattern": _NUMBER}], "x-unit": self.unit}


class Rows(NamedTuple):
    """Marks a `Span`: a whole number of rows, or a time with its unit.

    >>> Rows().span(5)
    Span(rows=5, seconds=None)
    """

    least: int = 1
    most: int = MOST

    def span(self, value: object) -> Span:
        """The span of a setting."""
        if isinstance(value, Span):
            return value
        if isinstance(value, str):
            text = told(lambda: expand(value))
            if text != value and text.isdecimal():  # a variable is never but text
                return self.span(int(text))
            seconds = told(lambda: number(text, "s"))
            if not 0.0 <= seconds < 1e9 or not told(lambda: written(text))[1]:
                raise _wrong(f"{self._rows} rows or a time such as '30 s'")
            return Span(seconds=seconds)
        if type(value) is not int or not self.least <= value <= self.most:
            raise _wrong(f"{self._rows} rows or a time such as '30 s'")
        return Span(value)

    @property
    def _rows(self) -> str:
        return f"{self.least} to {self.most}"

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.span)

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        rows = {"type": "integer", "minimum": self.least, "maximum": self.most}
        return {"anyOf": [rows, {"type": "string", "pattern": _NUMBER}], "x-unit": "s"}


@dataclass(frozen=True)
class Free:
    """Values whose meaning is another's: kept as written, quantities turned into SI numbers.

    >>> Free().plain({"base": "30 cm", "gears": [1, 2]})
    {'base': 0.3, 'gears': (1, 2)}
    """

    raw: bool = False
    """Kept word by word: quantities and ``${NAME}`` too."""

    def plain(self, value: object, path: Path = ()) -> object:
        """The values as they are kept."""
        if self.raw:
            return value
        if isinstance(value, Mapping):
            return {key: self.plain(item, (*path, key)) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return tuple(self.plain(item, (*path, i)) for i, item in enumerate(value))
        if isinstance(value, str):
            return told(lambda: as_number(expand(value)), path)
        return value

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.plain, handler(source))


@dataclass(frozen=True)
class Late:
    """``${NAME}`` is replaced when the value is used, not when the file is read.

    >>> Late() == Late()
    True
    """

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.str_schema(strict=True)


@dataclass(frozen=True)
class Key:
    """The key in the file, where it is no name in Python (``from``).

    >>> Key("from").key
    'from'
    """

    key: str


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
