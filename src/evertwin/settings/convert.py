"""From the plain values of a TOML file to checked sections.

Every problem is collected with its line, so that one look mends all of them. A message says what
was expected, what came, and for an unknown key the nearest one.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, TypeVar, get_args, get_origin

from evertwin.errors import UsageError, nearest
from evertwin.settings.fields import (
    Free,
    Inherit,
    Late,
    Limits,
    PlacedError,
    Quantity,
    Section,
    Setting,
    Shorthand,
    field_docs,
    last,
    options,
    settings,
    split,
)
from evertwin.settings.lines import Lines, Path
from evertwin.settings.quantity import as_number, number

__all__ = ["Reader", "expand"]

S = TypeVar("S", bound=Section)
Notes: TypeAlias = Sequence[object]
_NAME = re.compile(r"\$\{([A-Za-z_]\w*)(?::-([^}]*))?\}")


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


def dotted(path: Path) -> str:
    """The path as users write it.

    >>> dotted(("source", 0, "name"))
    'source[0].name'
    """
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


@dataclass
class Reader:
    """Builds sections and collects what is wrong.

    >>> @dataclass(frozen=True)
    ... class Clock(Section):
    ...     rate: float = 1.0
    >>> reader = Reader("a.toml", Lines("rates = 5"))
    >>> reader.section(Clock, {"rates": 5}, ())
    >>> reader.problems
    ["a.toml:1: unknown key 'rates', did you mean 'rate'?"]
    """

    file: str
    lines: Lines
    problems: list[str] = field(default_factory=list)
    written: Callable[[Path], Path] = tuple
    """Where a setting stands that the root section completed from elsewhere."""

    def section(self, kind: type[S], given: object, path: Path) -> S | None:
        """The section from its table; None if it cannot be built (see ``problems``)."""
        table = self._table(kind, given, path)
        if table is None:
            return None
        before = len(self.problems)
        known = {setting.key: setting for setting in settings(kind)}
        unit = table.get("unit")
        bare = unit if isinstance(unit, str) else ""
        values = {
            known[key].name: self._value(known[key], _inherited(known[key], table), path, bare)
            for key in table
            if key in known
        }
        self._unknown([key for key in table if key not in known], list(known), path)
        for setting in known.values():
            if setting.required and setting.key not in table:
                doc = field_docs(kind).get(setting.name, "").split("\n")[0]
                self._problem(path, f"{_in(self.written(path))}needs '{setting.key}': {doc}")
        if len(self.problems) > before:
            return None
        built: S | None = self._guarded(lambda: kind(**values), path)
        return built

    def _table(self, kind: type[S], given: object, path: Path) -> Mapping[str, Any] | None:
        short = getattr(kind, "shorthand", None)
        if isinstance(short, Shorthand) and not isinstance(given, Mapping):
            given = {short.key: given}
        if not isinstance(given, Mapping):
            self._wrong(path, "a table", given)
            return None
        table: Mapping[str, Any] | None = self._guarded(lambda: kind.prepare(given), path)
        return table

    def _value(self, setting: Setting, value: object, path: Path, bare: str) -> Any:
        at = (*path, setting.key)
        free = last(Free, setting.notes)
        if free is not None:
            return value if free.raw else self._free(value, at)
        return self._as(setting.type, (*setting.notes, _Bare(bare)), value, at)

    def _as(self, hint: Any, notes: Notes, value: object, path: Path) -> Any:
        members = [split(m) for m in options(hint) if m is not type(None)]
        if len(members) > 1:
            return self._either(members, notes, value, path)
        kind, more = members[0]
        notes = (*notes, *more)
        origin = get_origin(kind)
        if origin is tuple:
            return self._tuple(get_args(kind)[0], value, path)
        if origin is Literal:
            return self._choice(get_args(kind), value, path)
        if isinstance(kind, type) and issubclass(kind, Section):
            return self.section(kind, value, path)
        if origin is not None:
            return self._mapping(get_args(kind)[1], value, path)
        return _SCALARS[kind](self, notes, value, path)

    def _either(
        self, members: Sequence[tuple[Any, Notes]], notes: Notes, value: object, path: Path
    ) -> Any:
        for kind, more in members:
            if type(value) is kind or (kind is float and type(value) is int):
                return self._as(kind, (*notes, *more), value, path)
        return self._wrong(path, " or ".join(_WORDS[kind] for kind, _ in members), value)

    def _tuple(self, hint: Any, value: object, path: Path) -> Any:
        if not isinstance(value, list | tuple):
            return self._wrong(path, "an array such as ['a', 'b']", value)
        kind, notes = split(hint)
        return tuple(self._as(kind, notes, item, (*path, i)) for i, item in enumerate(value))

    def _mapping(self, hint: Any, value: object, path: Path) -> Any:
        if not isinstance(value, Mapping):
            return self._wrong(path, "a table", value)
        kind, notes = split(hint)
        return {key: self._as(kind, notes, item, (*path, key)) for key, item in value.items()}

    def _free(self, value: object, path: Path) -> Any:
        if isinstance(value, Mapping):
            return {key: self._free(item, (*path, key)) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return tuple(self._free(item, (*path, i)) for i, item in enumerate(value))
        if isinstance(value, str):
            text = value
            return self._guarded(lambda: as_number(expand(text)), path)
        return value

    def _choice(self, words: tuple[Any, ...], value: object, path: Path) -> Any:
        if value in words:
            return value
        near = difflib.get_close_matches(str(value), [str(w) for w in words], n=1)
        hint = f", did you mean '{near[0]}'?" if near else ""
        return self._wrong(path, "one of " + ", ".join(f"'{w}'" for w in words), value, hint)

    def _string(self, notes: Notes, value: object, path: Path) -> Any:
        if not isinstance(value, str):
            return self._wrong(path, _WORDS[str], value)
        return value if last(Late, notes) else self._guarded(lambda: expand(value), path)

    def _switch(self, notes: Notes, value: object, path: Path) -> Any:
        return value if isinstance(value, bool) else self._wrong(path, _WORDS[bool], value)

    def _whole(self, notes: Notes, value: object, path: Path) -> Any:
        if isinstance(value, bool) or not isinstance(value, int):
            return self._wrong(path, _WORDS[int], value)
        return self._limited(notes, value, value, path)

    def _real(self, notes: Notes, value: object, path: Path) -> Any:
        quantity = last(Quantity, notes)
        example = f" or text such as '2 {quantity.unit or 'cm'}'" if quantity else ""
        text = isinstance(value, str) and quantity is not None
        plain = isinstance(value, int | float) and not isinstance(value, bool)
        if not text and not plain:
            return self._wrong(path, f"a number{example}", value)
        size = self._guarded(lambda: _si(value, notes), path)
        if size is None or not math.isnan(size):
            return None if size is None else self._limited(notes, size, value, path)
        return self._wrong(path, f"a number{example}", value)

    def _limited(self, notes: Notes, size: Any, value: object, path: Path) -> Any:
        limits = last(Limits, notes) or Limits()
        return size if limits.hold(size) else self._wrong(path, f"a number {limits}", value)

    def _guarded(self, make: Callable[[], Any], path: Path) -> Any:
        try:
            return make()
        except UsageError as error:
            at = (*path, *error.path) if isinstance(error, PlacedError) else path
            where = dotted(self.written(path))
            self._problem(at, f"{where}: {error}" if path else str(error))
            return None

    def _unknown(self, keys: Sequence[str], names: Sequence[str], path: Path) -> None:
        for key in keys:
            at = (*path, key)
            where = _in(self.written(at)[:-1])
            self._problem(at, f"{where}unknown key '{key}', {nearest(key, names)}")

    def _wrong(self, path: Path, expected: str, value: object, hint: str = "") -> Any:
        shown = str(value).lower() if isinstance(value, bool) else repr(value)
        kept = shown if len(shown) <= 60 else f"{shown[:57]}..."
        self._problem(path, f"{dotted(self.written(path))}: expected {expected}, got {kept}{hint}")
        return None

    def _problem(self, path: Path, message: str) -> None:
        self.problems.append(f"{self.file}:{self.lines.of(self.written(path))}: {message}")


@dataclass(frozen=True)
class _Bare:
    """The unit of bare numbers, where the table names one."""

    unit: str


def _si(value: Any, notes: Notes) -> float:
    quantity = last(Quantity, notes)
    if quantity is None:
        return float(value)
    # the table's unit is that of what it is about, not of a share or a time beside it
    bare = _Bare("") if quantity.unit else last(_Bare, notes) or _Bare("")
    return number(value, quantity.unit, bare=bare.unit, difference=quantity.difference)


def _inherited(setting: Setting, table: Mapping[str, Any]) -> object:
    """The setting's value; sub-tables of an inheriting one start from the table around them."""
    value = table[setting.key]
    if not setting.has(Inherit) or not isinstance(value, Mapping):
        return value
    around = {key: item for key, item in table.items() if key != setting.key}
    return {k: {**around, **v} if isinstance(v, Mapping) else v for k, v in value.items()}


def _in(path: Path) -> str:
    return f"[{dotted(path)}] " if path else ""


_WORDS: dict[Any, str] = {
    bool: "true or false",
    float: "a number",
    int: "a whole number",
    str: "text",
}
_SCALARS: dict[Any, Callable[[Reader, Notes, object, Path], Any]] = {
    bool: Reader._switch,
    float: Reader._real,
    int: Reader._whole,
    str: Reader._string,
}
