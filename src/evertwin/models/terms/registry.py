"""Every kind of correction term by its name: those of the package, and those of other packages.

Another package registers a `CorrectionTerm` (an object, not its class) under the entry point group
``evertwin.terms``, by the kind's own name. A kind is imported when a form or a twin file names it.

>>> kind("lag").rank
3
>>> kind("lagg")
Traceback (most recent call last):
evertwin.errors.UsageError: no kind of correction term 'lagg', did you mean 'lag'?
"""

from __future__ import annotations

import importlib
from functools import cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

from evertwin.errors import UsageError, nearest

if TYPE_CHECKING:
    from evertwin.models.terms.contract import CorrectionTerm

GROUP = "evertwin.terms"
KINDS = (
    "lag", "slew", "coupling", "lever", "current", "law", "direction", "hysteresis", "wheels",
    "table", "surface", "state", "leak",
)  # fmt: skip
"""Those of the package, each in a file of its name; in the order in which they are tried."""


@cache
def kind(name: str) -> CorrectionTerm:
    """The kind of that name.

    Raises:
        UsageError: there is none, or what a package registered is none.
    """
    if name in KINDS:
        module = importlib.import_module(f"evertwin.models.terms.{name}")
        own: CorrectionTerm = module.KIND
        return own
    check_kind(name)
    point = entry_points(group=GROUP)[name]
    return checked(point.load(), name, point.value)


def check_kind(name: str) -> None:
    """Refuses what is no kind, without importing any.

    Raises:
        UsageError: there is no such kind.
    """
    if name in KINDS:
        return
    others = entry_points(group=GROUP).names
    if name not in others:
        raise UsageError(f"no kind of correction term {name!r}, {nearest(name, (*KINDS, *others))}")


def checked(found: Any, name: str, where: str) -> CorrectionTerm:
    """What another package registered, if it is a kind of that name."""
    contract = importlib.import_module("evertwin.models.terms.contract").CorrectionTerm
    if not isinstance(found, contract) or found.kind != name:
        raise UsageError(
            f"{where} is registered as {name!r}: expected a CorrectionTerm of that kind, got "
            f"{found!r}"
        )
    own: CorrectionTerm = found
    return own
