"""Numbers of a fit whose interval is a multiple of their size: these go live only where the rows
refute what they were, as weak ones."""

from __future__ import annotations

from collections.abc import Container
from typing import NamedTuple

from evertwin.tuning import Fit
from evertwin.tuning.intervals.fit import Amend

REFUTED = "no more is told of it than that it is not as before"


class Told(NamedTuple):
    """What is left to tune.

    >>> Told((), "", ()).names
    ()
    """

    names: tuple[str, ...]
    """The other numbers; none where none of the version's is left."""
    why: str
    """Which stay where they are, and why."""
    loose: tuple[str, ...]
    """Which these are."""


def known(fit: Fit, own: Container[str]) -> Told | None:
    """The fit's numbers without those that moved and are not told; None: it has no such.

    A number that no direction of the rows speaks for stays where it is in the fit already. One that
    moved and is not told all the same has an interval that is a multiple of its size.

    Args:
        fit: to some rows.
        own: names of the version's numbers; the rest are starts of recordings.
    """
    moved = (fit.values != fit.start).tolist()
    judged = zip(fit.names, fit.verdict, fit.reasons, moved, strict=True)
    loose = {name: why for name, word, why, on in judged if word == "not" and on and name in own}
    if not loose:
        return None
    names = tuple(name for name in fit.names if name not in loose)
    said = ", ".join(f"{name}: {why}" for name, why in loose.items())
    left = names if any(name in own for name in names) else ()
    return Told(left, f"what the rows do not tell stays as it was ({said})", tuple(loose))


def weakened(fit: Fit, rest: Told) -> Fit:
    """The fit in which these numbers are weak: the others leave clearly more where they were."""
    return fit.amended({fit.names.index(n): Amend(None, "weak", (REFUTED,)) for n in rest.loose})
