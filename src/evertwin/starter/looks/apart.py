"""What tells columns apart: not what a file or a namespace shares by all that it holds.

A file called ``diffA_cmd_vel.csv`` beside ``diffA_pose.csv`` says of its columns that they are
commands, and not that they are differences; ``/target_bot/cmd_vel/linear/x`` beside
``/target_bot/odom/pose/position/x`` is told, and the other one is measured.

>>> names = ["/target_bot/cmd_vel/linear/x", "/target_bot/odom/pose/position/x"]
>>> list(bare(names).values())
['cmd_vel/linear/x', 'odom/pose/position/x']
>>> themes(["set3_cmd_vel", "set3_pose"]), themes(["errors"])
(['cmd vel', 'pose'], [''])
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from evertwin.starter.looks.words import OTHERS, WHEEL, quantity, role, words

_LEVEL = re.compile(r"[/.]")


def themes(names: Sequence[str], files: bool = True) -> list[str]:
    """What the names of tables say of their columns: the words that not all of them have.

    A file is named after its run, too: nobody calls one a difference, a limit or an error because
    its columns are, and one that says both "told" and "measured" says neither.
    """
    said = [words(name) for name in names]
    common = set.intersection(*map(set, said)) if said else set[str]()
    own = [[word for word in one if word not in common] for one in said]
    if not files:
        return [" ".join(one) for one in own]
    own = [[word for word in one if word not in OTHERS] for one in own]
    return ["" if _contradicts(one) else " ".join(one) for one in own]


def _contradicts(said: Sequence[str]) -> bool:
    return {role([word]) for word in said} >= {"command", "measured"}


def bare(names: Sequence[str], told: Sequence[str] = ()) -> dict[str, str]:
    """Each name without the namespace that tells nothing of it, where all stay apart.

    Args:
        names: to be cut.
        told: those of what could feed a channel, by which it is decided; none: all.
    """
    below: dict[str, list[list[str]]] = {}
    told = told or names
    for name in told:
        for at in _levels(name):
            below.setdefault(name[:at], []).append(words(name[at:]))
    empty = {above for above, said in below.items() if _denied(above, said, len(told))}
    cut = {
        name: name[max((at for at in _levels(name) if name[:at] in empty), default=0) :]
        for name in names
    }
    return cut if len(set(cut.values())) == len(cut) else {name: name for name in names}


def _levels(name: str) -> list[int]:
    """Where the parts of a name begin that stand below others."""
    return [found.end() for found in _LEVEL.finditer(name)][:_DEEPEST]


def _denied(above: str, below: Sequence[Sequence[str]], every: int) -> bool:
    """Would a namespace say of all below it what some of them deny? A difference of all that is
    recorded, a command of what is measured, a quantity of another, one wheel of a whole base."""
    said = words(above)
    what, named = role(said), quantity(said)
    roles, quantities = {role(one) for one in below}, {quantity(one) for one in below} - {""}
    other = bool(named) and len(quantities) > 1
    whole = len(below) == every > 1
    both = roles >= {"command", "measured"} or (what == "other" and whole)
    if what in ("command", "other"):
        return both and (other or not named)
    return (other or (whole and not named and not WHEEL.isdisjoint(said))) and not what


_DEEPEST = 8
"""Levels of a name that are looked at."""
