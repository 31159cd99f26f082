"""Versions of a model: data, not objects. A version is a form and parameter values.

The form says which variant of the base model and which correction terms; `Corrected` turns it into
a Model. Promoting a version replaces arrays; its hash names its content for ever.

>>> v = Version(number=0, form=Form(), names=("gain",), values=(1.0,), reason="as configured")
>>> v.hash[:12] == Version(number=5, form=Form(), names=("gain",), values=(1.0,)).hash[:12]
True
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from textwrap import shorten
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import few
from evertwin.fold.records import canonical, plain
from evertwin.types import Json, ParameterVector


@dataclass(frozen=True)
class Term:
    """One correction term: its structure. Its numbers are parameters of the corrected model.

    >>> Term("table", "v", levels=(0.0, 0.1, 0.2)).source
    ''
    """

    kind: str
    """Of those in `evertwin.models.terms.registry`."""
    channel: str
    """Input that it changes, or the state that it couples to."""
    source: str = ""
    """Second channel, of a kind that has one."""
    variant: str = ""
    """Shape, where a kind has several: a law's ``dead zone`` or ``clamp``, …"""
    levels: tuple[float, ...] = ()
    """Grid, of a kind that has one: of the first channel."""
    levels2: tuple[float, ...] = ()
    """Grid of the second channel."""

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Term:
        """The term that ``plain(term)`` was made of."""
        fields: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list | tuple) else v for k, v in content.items()
        }
        return cls(**fields)


@dataclass(frozen=True)
class Form:
    """Which variant of the base model, and which terms on top, in order.

    >>> Form(variant=(("friction_law.j1", "stribeck"),)).terms
    ()
    """

    terms: tuple[Term, ...] = ()
    variant: tuple[tuple[str, str], ...] = ()
    """(aspect, choice) of a base model that has variants, sorted."""

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Form:
        """The form that ``plain(form)`` was made of."""
        variant = tuple((str(aspect), str(choice)) for aspect, choice in content["variant"])
        return cls(tuple(Term.from_json(term) for term in content["terms"]), variant)


class Size(NamedTuple):
    """How large an output was in what a version was learned from.

    >>> Size.from_json(["level", 2, 25.0, 0.0, 0.0, 0.0]).rows
    2
    """

    output: str
    rows: int
    squares: float
    """Σ measurement²."""
    lowest: float
    highest: float
    """Of a temperature, whose size is its range; 0 of other outputs."""
    jumps: float
    """Σ (change since the row before)²."""

    @classmethod
    def from_json(cls, content: Sequence[Any]) -> Size:
        """The size that ``plain(size)`` was made of."""
        return cls(str(content[0]), int(content[1]), *(float(one) for one in content[2:]))


@dataclass(frozen=True)
class Version:
    """A form with its parameter values: everything the live model is.

    >>> Version(3, Form(), ("Fc",), (12.0,)).p.tolist()
    [12.0]
    """

    number: int
    form: Form
    names: tuple[str, ...]
    values: tuple[float, ...]
    parent: int | None = None
    """Version it was made from."""
    reason: str = ""
    row: int = 0
    """Row at which it became known."""
    sizes: tuple[Size, ...] = ()
    """Of outputs, in what it, or a version that it was made from, was fitted to."""

    def __repr__(self) -> str:
        told = (f"{name}={value:.6g}" for name, value in zip(self.names, self.values, strict=True))
        terms = [f"{term.kind} on {term.channel}" for term in self.form.terms]
        why = shorten(self.reason, 60, placeholder=" …")
        return f"<Version {self.number}: {', '.join([few(told), *terms])} ({why})>"

    @cached_property
    def hash(self) -> str:
        """SHA-256 of form, names and values: equal content, equal hash."""
        content = canonical((self.form, self.names, self.values))
        return hashlib.sha256(content.encode()).hexdigest()

    @property
    def p(self) -> ParameterVector:
        """Parameter values, a fresh array."""
        return np.array(self.values, dtype=np.float64)

    def to_json(self) -> Json:
        """Plain content, for a store."""
        return plain(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Version:
        """The version that ``to_json`` was made of."""
        form = Form.from_json(content["form"])
        return cls(
            int(content["number"]), form, tuple(content["names"]), tuple(content["values"]),
            content["parent"], str(content["reason"]), int(content["row"]),
            tuple(map(Size.from_json, content.get("sizes", ()))),
        )  # fmt: skip
