"""Options of a model's factory that it does not know.

>>> check_options("arm", {"gravty": 9.81}, ("gravity", "tip"))
Traceback (most recent call last):
evertwin.errors.UsageError: arm: no option 'gravty', did you mean 'gravity'?
"""

from __future__ import annotations

from collections.abc import Iterable

from evertwin.errors import UsageError, nearest


def check_options(kind: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Are all options ``given`` to a model of this kind known?

    Raises:
        UsageError: one is not; the nearest known one, or all of them.
    """
    names = sorted(known)
    for key in given:
        if key not in names:
            raise UsageError(f"{kind}: no option {key!r}, {nearest(key, names)}")
