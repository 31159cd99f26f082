"""Every friction term by its name: those of the package, and those that other packages add.

Another package registers a `FrictionTerm` under the entry point group ``evertwin.friction``, by the
term's own name. It is looked up when a law names it.

>>> term("load").coefficients[0].name
'Fl'
>>> term("wind")
Traceback (most recent call last):
evertwin.errors.UsageError: friction: no term 'wind'; there are direction, stribeck, root, load...
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import entry_points

from evertwin.errors import UsageError
from evertwin.machines.friction.contract import FrictionTerm
from evertwin.machines.friction.terms.balance import BALANCE
from evertwin.machines.friction.terms.coulomb import COULOMB
from evertwin.machines.friction.terms.direction import DIRECTION
from evertwin.machines.friction.terms.load import LOAD
from evertwin.machines.friction.terms.offset import OFFSET
from evertwin.machines.friction.terms.position import POSITION
from evertwin.machines.friction.terms.root import ROOT
from evertwin.machines.friction.terms.spring import SPRING
from evertwin.machines.friction.terms.stribeck import STRIBECK
from evertwin.machines.friction.terms.temperature import TEMPERATURE
from evertwin.machines.friction.terms.two_sided import TWO_SIDED
from evertwin.machines.friction.terms.viscous import VISCOUS

GROUP = "evertwin.friction"
_BUILT_IN = (
    VISCOUS, DIRECTION, COULOMB, OFFSET, STRIBECK, ROOT, LOAD, TWO_SIDED, TEMPERATURE, POSITION,
    SPRING, BALANCE,
)  # fmt: skip
"""In the order of a law's parameters, and of the ladder."""
ALWAYS = (VISCOUS, COULOMB, OFFSET)
"""What every law has."""


def ordered(terms: Iterable[FrictionTerm]) -> tuple[FrictionTerm, ...]:
    """Each term once, the package's in their order, others behind them."""
    given = tuple(dict.fromkeys(terms))
    return (
        *(item for item in _BUILT_IN if item in given),
        *(item for item in given if item not in _BUILT_IN),
    )


@cache
def term(name: str) -> FrictionTerm:
    """The term of that name.

    Raises:
        UsageError: there is none, or what a package registered is none.
    """
    own = {item.name: item for item in _BUILT_IN if not item.always}
    if name in own:
        return own[name]
    others = {point.name: point for point in entry_points(group=GROUP)}
    if name in others:
        return checked(others[name].load(), name, others[name].value)
    raise UsageError(f"friction: no term {name!r}; there are {', '.join((*own, *others))}")


def checked(found: object, name: str, where: str) -> FrictionTerm:
    """What another package registered, if it is a term that can stand beside the package's own."""
    if not isinstance(found, FrictionTerm) or found.name != name:
        raise UsageError(
            f"friction: {where} is registered as {name!r}: expected a FrictionTerm of that name, "
            f"got {found!r}"
        )
    taken = {other for item in _BUILT_IN for other in item.parameters}
    for one in found.parameters:
        if one in taken:
            raise UsageError(f"friction term {name!r}: the name {one!r} is taken")
    return found
