"""Columns that belong together because they say the same of each joint of an arm.

Headings that differ in one number (``q_0 … q_5``, ``J1_pos … J6_pos``), in the name of a joint
(``position.elbow``) or, several times, in the same words (``pan_deg tilt_deg pan_Nm tilt_Nm``,
``J1 Position … Z Position … J4 Position``) are a family, unless they say different quantities of
one joint; columns without headings are cut into as many as there are joints, one block after the
other.

>>> table = [f"{q}_{i}" for q in ("q", "tau") for i in range(3)]
>>> [family.columns for family in families(table, ("a", "b", "c"))]
[('q_0', 'q_1', 'q_2'), ('tau_0', 'tau_1', 'tau_2')]
>>> [family.stem for family in families(["X_mm", "Y_mm", "X_force_N", "Y_force_N"], ("a", "b"))]
['#_mm', '#_force_N']
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from evertwin.starter.looks.words import quantity

_WORD = re.compile(r"[A-Za-z]{2,}|(?<![A-Za-z])[A-Za-z](?![A-Za-z])")
_NAMED = re.compile(r"(?<![A-Za-z0-9])[A-Za-z]+\d*(?![A-Za-z0-9])")
"""A word with its number: of ``J1 J2 Z J4`` the third has none."""


class Family(NamedTuple):
    """One column for each joint, in the order of the joints.

    >>> Family("q_#", ("q_1", "q_2")).stem
    'q_#'
    """

    stem: str
    """The heading with # where they differ; empty for columns without headings."""
    columns: tuple[str, ...]


def families(names: Sequence[str], joints: Sequence[str]) -> tuple[Family, ...]:
    """All families of as many columns as there are ``joints``, in the order of the columns."""
    count = len(joints)
    if all(re.fullmatch(r"c\d+", name) for name in names):
        if len(names) % count:
            return ()
        parts = (names[i : i + count] for i in range(0, len(names), count))
        return tuple(Family("", tuple(part)) for part in parts)
    found = _by_joint(names, joints) | _by_number(names, count) or _by_word(names, count)
    place = {name: i for i, name in enumerate(names)}
    return tuple(sorted(found.values(), key=lambda family: place[family.columns[0]]))


def _by_joint(names: Sequence[str], joints: Sequence[str]) -> dict[str, Family]:
    """Headings that hold the name of a joint; the longest name that fits counts."""
    order = sorted(range(len(joints)), key=lambda i: -len(joints[i]))
    stems: dict[str, dict[int, str]] = {}
    for name in names:
        for i in order:
            at = name.lower().find(joints[i].lower())
            if at >= 0:
                stem = f"{name[:at]}#{name[at + len(joints[i]) :]}"
                stems.setdefault(stem, {})[i] = name
                break
    return {
        stem: Family(stem, tuple(there[i] for i in range(len(joints))))
        for stem, there in stems.items() if len(there) == len(joints)
    }  # fmt: skip


def _by_word(names: Sequence[str], count: int) -> dict[str, Family]:
    """Headings that differ in one word, where two families or more do so in the same words."""
    stems: dict[str, dict[str, str]] = {}
    for name in names:
        for found in (*_WORD.finditer(name), *_NAMED.finditer(name)):
            stem = f"{name[: found.start()]}#{name[found.end() :]}"
            stems.setdefault(stem, {})[found[0].lower()] = name
    whole = {
        stem: there for stem, there in stems.items() if len(there) == count > 1 and _alike(there)
    }
    often = Counter(tuple(there) for there in whole.values())
    return {
        stem: Family(stem, tuple(there.values()))
        for stem, there in whole.items() if often[tuple(there)] > 1
    }  # fmt: skip


def _alike(there: Iterable[str]) -> bool:
    """Do words that differ name joints, and not what is measured of one?"""
    return len({quantity([word]) for word in there} - {""}) < 2


def _by_number(names: Sequence[str], count: int) -> dict[str, Family]:
    """Headings that differ in one number, which counts from 0 or 1.

    One or two more than there are joints are a gripper's; whole multiples are several families.
    """
    stems: dict[str, dict[int, str]] = {}
    for name in names:
        for found in re.finditer(r"\d+", name):
            stem = f"{name[: found.start()]}#{name[found.end() :]}"
            stems.setdefault(stem, {})[int(found[0])] = name
    out = {}
    for stem, there in stems.items():
        first = min(there)
        run = [there[first + i] for i in range(len(there)) if first + i in there]
        whole = first in (0, 1) and len(run) == len(there)
        if whole and count <= len(run) <= count + 2:
            out[stem] = Family(stem, tuple(run[:count]))
        elif whole and len(run) % count == 0:
            for at in range(0, len(run), count):
                out[f"{stem} {at}"] = Family(stem, tuple(run[at : at + count]))
    return out
