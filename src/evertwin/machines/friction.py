"""Friction of a drive: a ladder of laws, every one linear in its coefficients.

With the velocity ``v`` and a switch ``s(v)``, which is ``sign v`` outside a standstill or
``tanh(v / width)``, the friction is

    f = Fv·v + offset + s(v)·(Fc + Fs·exp(−(v / vs)²) + Fr·√|v| + Fl·|load|)

viscous and Coulomb friction, a constant, the Stribeck peak, the lubricant film and the share of the
transmitted load. A law names the terms it has, joined by ``+``; the ladder is climbed only while
the error on unseen data falls.

>>> law = Law.parse("tanh+stribeck+load")
>>> [item.name for item in law.parameters(suffix="3")]
['Fv3', 'Fc3', 'offset3', 'Fs3', 'Fl3', 'vs3', 'width3']
>>> str(law)
'tanh+stribeck+load'

Direction-dependent friction adds ``Fv_back·min(v, 0)``: viscous friction is ``Fv`` forwards and
``Fv + Fv_back`` backwards, so a law without it is the same law with a zero. A Coulomb friction by
direction needs no term of its own: while the drive moves it *is* ``Fc`` with ``offset`` (their sum
forwards, their difference backwards), so both together can never be told apart.

Where a temperature ``T`` is known, ``Fv`` and ``Fc`` may change with it: ``Fv + Fv_T·(T − T0)`` and
``Fc + Fc_T·(T − T0)``, still linear. That is a second table of the same kind, multiplied with
``T − T0`` (`warm_table`, `warm_force`). Straight lines hold over the tens of kelvin of a warm-up;
over more, viscous friction falls like an exponential (Bittencourt and Axehill, "An extended
friction model to capture load and temperature effects in robot joints", 2010).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from evertwin.errors import UsageError
from evertwin.models import Parameter
from evertwin.settings.quantity import number

__all__ = [
    "COLUMNS",
    "SLOTS",
    "Law",
    "Rung",
    "feature",
    "force",
    "shape_of",
    "sliding",
    "switch",
    "warm_force",
    "warm_parameters",
    "warm_table",
]

VISCOUS, BACKWARD, COULOMB, OFFSET, STRIBECK, ROOT, LOAD, INERTIA, VS, WIDTH = range(10)
SLOTS = 10
"""Length of a drive's table: where in ``p`` each slot lies, −1 where the law lacks it."""
COLUMNS = 8
"""The first slots are linear coefficients; the others shape the features."""

_TERMS = ("direction", "stribeck", "root", "load")
_LINEAR = {
    VISCOUS: ("Fv", "Nms/rad"), BACKWARD: ("Fv_back", "Nms/rad"), COULOMB: ("Fc", "Nm"),
    OFFSET: ("offset", "Nm"), STRIBECK: ("Fs", "Nm"), ROOT: ("Fr", "N*m*s**0.5"), LOAD: ("Fl", "1"),
}  # fmt: skip
_SLIDING = {
    "Nms/rad": "Ns/m", "Nm": "N", "rad/s": "m/s", "N*m*s**0.5": "N*s**0.5/m**0.5",
    "Nms/(rad*K)": "Ns/(m*K)", "Nm/K": "N/K",
}  # fmt: skip


class Rung(NamedTuple):
    """One step up the ladder: parameters that join the fit, all for one output.

    >>> Law.parse("sign+load").rungs("1")[0].add
    ('Fl1',)
    """

    name: str
    """What the step adds: direction, stribeck, root or load."""
    add: tuple[str, ...]
    """Names of parameters that become editable; until then they stay at zero."""
    output: int = 0
    """The output that it is for; only there it has to pay."""


@dataclass(frozen=True)
class Law:
    """The terms of one drive's friction. See the module for the formula.

    >>> Law().switch, Law(load=True).terms
    ('sign', ('load',))
    """

    switch: str = "sign"
    """``sign`` (zero below ``standstill``) or ``tanh``."""
    direction: bool = False
    stribeck: bool = False
    root: bool = False
    load: bool = False
    width: float = 0.02
    """Velocity at which ``tanh`` has reached 0.76 [rad/s or m/s]."""
    vs: float = 0.2
    """Velocity at which the Stribeck peak has fallen to 1/e."""
    standstill: float = 1e-3
    """Speed below which ``sign`` is zero: there friction is undetermined."""

    def __post_init__(self) -> None:
        if self.switch not in ("sign", "tanh"):
            raise UsageError(f"friction: expected 'sign' or 'tanh' first, got {self.switch!r}")
        if not (self.width > 0 and self.vs > 0 and self.standstill >= 0):
            raise UsageError("friction: expected width > 0, vs > 0 and standstill ≥ 0")

    @classmethod
    def parse(cls, text: str) -> Law:
        """A law from its name, such as ``sign`` or ``tanh+stribeck+load``.

        Raises:
            UsageError: a term is not known.
        """
        switch, *terms = text.split("+")
        for term in terms:
            if term not in _TERMS:
                raise UsageError(f"friction: no term {term!r}; there are {', '.join(_TERMS)}")
        return cls(switch, **dict.fromkeys(terms, True))

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms beyond viscous, Coulomb and offset, in the order of the ladder."""
        return tuple(term for term in _TERMS if getattr(self, term))

    def __str__(self) -> str:
        return "+".join((self.switch, *self.terms))

    def _has(self, slot: int) -> bool:
        needs = {BACKWARD: "direction", STRIBECK: "stribeck", ROOT: "root", LOAD: "load"}
        if slot == WIDTH:
            return self.switch == "tanh"
        if slot == INERTIA:
            return False
        return bool(getattr(self, needs.get(STRIBECK if slot == VS else slot, "switch")))

    def _item(self, slot: int, suffix: str) -> Parameter:
        if slot in (WIDTH, VS):
            name, value = ("width", self.width) if slot == WIDTH else ("vs", self.vs)
            return Parameter(name + suffix, value, "rad/s", 1e-6, 100.0, editable=False)
        name, unit = _LINEAR[slot]
        # A Stribeck peak or a root may take more than its share, which Fv and Fc then give back:
        # there the sum resists, not each term.
        alone = slot in (VISCOUS, COULOMB) and not (self.stribeck or self.root)
        return Parameter(name + suffix, 0.0, unit, resists=alone)

    def parameters(self, suffix: str = "") -> tuple[Parameter, ...]:
        """The law's parameters, linear ones first; names end in ``suffix``. Torque units."""
        return tuple(self._item(slot, suffix) for slot in range(SLOTS) if self._has(slot))

    def table(self, names: tuple[str, ...], suffix: str = "") -> list[int]:
        """Where in ``names`` each slot lies, (SLOTS,); −1 where the law lacks it."""
        return [
            names.index(self._item(slot, suffix).name) if self._has(slot) else -1
            for slot in range(SLOTS)
        ]

    def rungs(self, suffix: str = "") -> tuple[Rung, ...]:
        """The steps from viscous + Coulomb + offset up to this law, in the ladder's order."""
        slots = {"direction": BACKWARD, "stribeck": STRIBECK, "root": ROOT, "load": LOAD}
        return tuple(Rung(t, (self._item(slots[t], suffix).name,)) for t in self.terms)

    def only(self, terms: Sequence[str]) -> Law:
        """The law with these of its terms.

        >>> str(Law.parse("tanh+root+load").only(("load",)))
        'tanh+load'
        """
        return self.without(*(term for term in self.terms if term not in terms))

    def without(self, *terms: str) -> Law:
        """The law without some of its terms."""
        return replace(self, **dict.fromkeys(terms, False))  # type: ignore[arg-type]


def shape_of(given: Mapping[str, float | str]) -> dict[str, Any]:
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


def sliding(item: Parameter) -> Parameter:
    """A parameter of a law in units of force instead of torque, for what slides.

    >>> sliding(Law().parameters()[1]).unit
    'N'
    """
    return replace(item, unit=_SLIDING.get(item.unit, item.unit))


def warm_parameters() -> tuple[Parameter, ...]:
    """How viscous and Coulomb friction change with temperature, and the reference temperature.

    >>> [item.name for item in warm_parameters()]
    ['Fv_T', 'Fc_T', 'T0']
    """
    return (
        Parameter("Fv_T", 0.0, "Nms/(rad*K)"),
        Parameter("Fc_T", 0.0, "Nm/K"),
        Parameter("T0", 293.15, "K", 1.0, 2000.0, editable=False),
    )


def warm_table(table: Sequence[int], viscous: int, coulomb: int) -> list[int]:
    """The table of what is multiplied with ``T − T0``: shapes as in ``table``, two coefficients.

    Args:
        viscous, coulomb: where in ``p`` ``Fv_T`` and ``Fc_T`` lie.

    >>> warm_table([0, -1, 1, 2, -1, -1, -1, -1, -1, 3], 4, 5)
    [4, -1, 5, -1, -1, -1, -1, -1, -1, 3]
    """
    warm = [-1] * SLOTS
    warm[VISCOUS], warm[COULOMB] = viscous, coulomb
    warm[VS], warm[WIDTH] = table[VS], table[WIDTH]
    return warm


@njit(cache=True)
def switch(v: float, width: float, standstill: float) -> float:
    """``tanh(v / width)`` for a width above zero, else the sign outside the standstill."""
    if width > 0.0:
        return math.tanh(v / width)
    if v > standstill:
        return 1.0
    if v < -standstill:
        return -1.0
    return 0.0


@njit(cache=True)
def feature(slot: int, v: float, s: float, load: float, vs: float) -> float:
    """What the coefficient in ``slot`` is multiplied with; ``s``: the switch at ``v``."""
    if slot == VISCOUS:
        return v
    if slot == BACKWARD:
        return min(v, 0.0)
    if slot == COULOMB:
        return s
    if slot == OFFSET:
        return 1.0
    if slot == STRIBECK:
        return s * math.exp(-((v / vs) ** 2))
    if slot == ROOT:
        return s * math.sqrt(abs(v))
    return s * abs(load)


@njit(cache=True)
def force(table: Any, at: int, p: Any, v: float, load: float, standstill: float) -> float:
    """Friction of one drive, whose table starts at ``at``; positive against positive motion."""
    width = p[table[at + WIDTH]] if table[at + WIDTH] >= 0 else 0.0
    vs = p[table[at + VS]] if table[at + VS] >= 0 else 1.0
    s = switch(v, width, standstill)
    total = 0.0
    for slot in range(INERTIA):
        index = table[at + slot]
        if index >= 0:
            total += p[index] * feature(slot, v, s, load, vs)
    return total


@njit(cache=True)
def warm_force(table: Any, at: int, p: Any, v: float, above: float, standstill: float) -> float:
    """What a temperature ``above`` the reference [K] adds to `force`; ``at``: a warm table."""
    return float(above * force(table, at, p, v, 0.0, standstill))


def features(law: Law, v: np.ndarray, load: np.ndarray) -> np.ndarray:
    """The regressor of a law at its own ``width`` and ``vs``, (n, number of linear parameters).

    >>> features(Law(), np.array([2.0, -1.0, 0.0]), np.zeros(3)).tolist()
    [[2.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [0.0, 0.0, 1.0]]
    """
    width = law.width if law.switch == "tanh" else 0.0
    s = [switch(x, width, law.standstill) for x in v.tolist()]
    slots = [slot for slot in range(INERTIA) if law._has(slot)]
    rows = [
        [feature(k, x, y, z, law.vs) for k in slots]
        for x, y, z in zip(v.tolist(), s, load.tolist(), strict=True)
    ]
    return np.array(rows).reshape(len(v), len(slots))
