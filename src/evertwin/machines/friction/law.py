"""A friction law: a switch and terms, as a twin file names it.

>>> Law.parse("sign+load").rungs("1")[0].add
('Fl1',)
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, runtime_checkable

from evertwin.errors import UsageError
from evertwin.machines.friction.contract import Coefficient, FrictionTerm, Shape
from evertwin.machines.friction.registry import ALWAYS, ordered, term
from evertwin.models.parameters import Parameter
from evertwin.settings.quantity import number

_WIDTH = Shape("width", 0.02, "rad/s", "m/s")
"""Velocity at which ``tanh`` has reached 0.76."""
STANDSTILL = 1e-3
_KNOWN = {
    "load": "the load that the drive transmits",
    "T": "a temperature",
    "q": "the position of the drive",
}


class Rung(NamedTuple):
    """One step up the ladder: parameters that join the fit, all for one output.

    >>> Law.parse("sign+load").rungs("1")[0].name
    'load'
    """

    name: str
    """What the step adds: direction, stribeck, root, load, or a term of another package."""
    add: tuple[str, ...]
    """Names of parameters that become editable; until then they stay at zero."""
    output: int = 0
    """The output that it is for; only there it has to pay."""
    cause: str = ""
    """What it means, in a few words."""
    shape: tuple[tuple[str, float], ...] = ()
    """Speeds inside its features, each with what it is where nobody says."""
    switch: tuple[tuple[str, float], ...] = ()
    """Width of a smooth switch that it could be taken for, likewise."""
    width: tuple[tuple[str, float], ...] = ()
    """That of its law, where no term of the law could be taken for it, likewise."""


@runtime_checkable
class Rubbing(Protocol):
    """A machine whose parameters include friction.

    >>> from evertwin.machines.drive import Drive
    >>> isinstance(Drive(), Rubbing), Drive().rubbing
    (True, ('Fv', 'Fc'))
    """

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the coefficients that take power out."""
        ...


@dataclass(frozen=True)
class Law:
    """The terms of one drive's friction. See `evertwin.machines.friction` for the formula.

    >>> Law().switch, Law.parse("sign+load").names
    ('sign', ('load',))
    """

    switch: str = "sign"
    """``sign`` (zero below ``standstill``) or ``tanh``."""
    terms: tuple[FrictionTerm, ...] = ALWAYS
    """In the order of the ladder."""
    start: tuple[tuple[str, float], ...] = ()
    """Where shape numbers start, by name, if not where their terms say."""
    standstill: float = STANDSTILL
    """Speed below which ``sign`` is zero: there friction is undetermined."""

    def __post_init__(self) -> None:
        if self.switch not in ("sign", "tanh"):
            raise UsageError(f"friction: expected 'sign' or 'tanh' first, got {self.switch!r}")
        if not self.standstill >= 0:
            raise UsageError(f"friction: expected standstill ≥ 0, got {self.standstill}")
        for name, value in self.start:
            if not value > 0:
                raise UsageError(f"friction: expected {name} > 0, got {value}")

    @classmethod
    def parse(cls, text: str) -> Law:
        """A law from its name, such as ``sign`` or ``tanh+stribeck+load``.

        Raises:
            UsageError: a term is not known.
        """
        switch, *names = text.split("+")
        return cls(switch, ordered((*ALWAYS, *map(term, names))))

    def shaped(self, values: Mapping[str, float]) -> Law:
        """The law whose shape starts elsewhere: ``width``, ``standstill``, numbers of its terms.

        >>> Law.parse("tanh").shaped({"width": 0.01, "standstill": 0.0}).shape
        {'width': 0.01, 'standstill': 0.0}
        """
        start = dict(self.start) | dict(values)
        standstill = start.pop("standstill", self.standstill)
        return replace(self, start=tuple(start.items()), standstill=standstill)

    @property
    def shape(self) -> dict[str, float]:
        """Where every number that is not linear starts."""
        return {item.name: item.value for item in self._shapes} | {"standstill": self.standstill}

    @property
    def names(self) -> tuple[str, ...]:
        """Terms beyond viscous, Coulomb and offset, in the order of the ladder."""
        return tuple(item.name for item in self.terms if not item.always)

    @property
    def reads(self) -> frozenset[str]:
        """What its terms depend on besides speed: load, T, q."""
        return frozenset(what for item in self.terms for what in item.reads)

    def __str__(self) -> str:
        return "+".join((self.switch, *self.names))

    @property
    def coefficients(self) -> tuple[tuple[FrictionTerm, Coefficient], ...]:
        """The linear numbers, each with its term, in the order of the parameters."""
        return tuple((item, one) for item in self.terms for one in item.coefficients)

    def rubbing(self, suffix: str = "") -> tuple[str, ...]:
        """Names of the coefficients that are friction: all but a constant force.

        >>> Law().rubbing("1")
        ('Fv1', 'Fc1')
        """
        return tuple(one.name + suffix for _, one in self.coefficients if not one.bias)

    def biases(self, suffix: str = "") -> tuple[str, ...]:
        """Names of the coefficients that are a constant force."""
        return tuple(one.name + suffix for _, one in self.coefficients if one.bias)

    @property
    def _shapes(self) -> tuple[Shape, ...]:
        """The numbers that are not linear: the terms', then the switch's."""
        own = [shape for item in self.terms for shape in item.shape]
        own += [_WIDTH] if self.switch == "tanh" else []
        given = dict(self.start)
        return tuple(replace(shape, value=given.get(shape.name, shape.value)) for shape in own)

    def parameters(self, suffix: str = "", slides: bool = False) -> tuple[Parameter, ...]:
        """The law's parameters, linear ones first; names end in ``suffix``.

        Args:
            slides: units of force and way instead of torque and angle.

        >>> Law().parameters(slides=True)[1].unit
        'N'
        """
        traded = {name for item in self.terms for name in item.confused_with}
        linear = [
            one.parameter(suffix, slides, resists=item.name not in traded)
            for item, one in self.coefficients
        ]
        return (*linear, *(shape.parameter(suffix, slides) for shape in self._shapes))

    def rungs(self, suffix: str = "") -> tuple[Rung, ...]:
        """The steps from viscous + Coulomb + offset up to this law, in the ladder's order."""
        smooth = ((_WIDTH.name + suffix, _WIDTH.value),) if self.switch == "tanh" else ()
        traded = any("coulomb" in item.confused_with for item in self.terms if not item.always)
        return tuple(
            Rung(
                item.name, tuple(one.name + suffix for one in item.coefficients), cause=item.cause,
                shape=tuple((x.name + suffix, x.value) for x in item.shape if x.sliding == "m/s"),
                switch=smooth if "coulomb" in item.confused_with else (),
                width=() if traded else smooth,
            )
            for item in self.terms
            if not item.always
        )  # fmt: skip

    def only(self, names: Sequence[str]) -> Law:
        """The law with these of its terms.

        >>> str(Law.parse("tanh+root+load").only(("load",)))
        'tanh+load'
        """
        return self.without(*(name for name in self.names if name not in names))

    def without(self, *names: str) -> Law:
        """The law without some of its terms."""
        return replace(self, terms=tuple(item for item in self.terms if item.name not in names))

    def plus(self, *terms: FrictionTerm) -> Law:
        """The law with more terms."""
        return replace(self, terms=ordered((*self.terms, *terms)))

    def known_to(self, who: str, known: Collection[str]) -> Law:
        """The law itself, if its terms read nothing but what a machine knows.

        Raises:
            UsageError: a term reads something else.
        """
        for item in self.terms:
            for what in item.reads:
                if what not in known:
                    raise UsageError(
                        f"{who}: friction by {item.name!r} needs {_KNOWN[what]}, which is not "
                        f"known here: take it out of the law {str(self)!r}"
                    )
        return self


def shape_of(given: Mapping[str, float | str]) -> dict[str, float]:
    """Width, ``vs`` and standstill of a law [rad/s or m/s] from numbers or texts with a unit.

    Raises:
        UsageError: one of them is no speed.

    >>> shape_of({"width": 0.01, "vs": "5 cm/s"})
    {'width': 0.01, 'vs': 0.05}
    """
    return {key: _speed(key, value) for key, value in given.items()}


def _speed(key: str, value: float | str) -> float:
    for unit in ("rad/s", "m/s"):
        with suppress(UsageError):
            return number(value, unit)
    raise UsageError(f"friction: {key}: expected a speed in rad/s or m/s, got {value!r}")
