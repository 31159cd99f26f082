"""Topics of several machines in one bag: the channels of one machine are taken from one namespace.

A namespace is what some topics' names begin with (``/alpha`` of ``/alpha/cmd_vel``). Topics that
are in no machine's namespace belong to all.

>>> namespaces(["/tf", "/alpha/cmd_vel", "/alpha/imu/raw", "/beta/odom"])
['/alpha/imu', '/alpha', '/beta']
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from evertwin.errors import UsageError
from evertwin.signals import conversion, unwrapped
from evertwin.signals.related import Follows, follows
from evertwin.sources.columns.names import closest
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK, Match, Proposal
from evertwin.types import Vector

_TURNS, _GOES = "w", ("v", "vx")
"""What a base is told: how fast it turns, and how fast it goes ahead."""
_POSE = ("x", "y", "heading")


def namespaces(topics: Sequence[str]) -> list[str]:
    """Of these topics, the deepest first."""
    found = dict.fromkeys(
        topic[:end]
        for topic in topics if topic.startswith("/")
        for end in range(2, len(topic)) if topic[end] == "/"
    )  # fmt: skip
    return sorted(found, key=lambda name: -name.count("/"))


def of_namespace(seen: Sequence[Seen], name: str) -> tuple[Seen, ...]:
    """The tables in a namespace, and those in none.

    Raises:
        UsageError: there is no such namespace.
    """
    name = f"/{name.strip('/')}"
    known = namespaces([one.table.name for one in seen])
    if name not in known:
        raise UsageError(f"--namespace {name}: {closest(name, known) or 'the topics have none'}")
    return tuple(one for one in seen if _in(one, name) or not one.table.name.rfind("/") > 0)


def of_one_machine(
    seen: tuple[Seen, ...], proposed: Callable[[tuple[Seen, ...]], Proposal | None]
) -> tuple[tuple[Seen, ...], tuple[str, ...]]:
    """The tables of one machine, and what is to be said of the others.

    Args:
        seen: all tables.
        proposed: a proposal of some tables; None where these leave something to ask.
    """
    names = _apart(seen)
    whole = proposed(seen) if names else None
    parts = {name: of_namespace(seen, name) for name in names}
    found = {name: proposed(part) for name, part in parts.items()}
    homes = [
        name for name, one in found.items() if one is not None and _home(one, parts[name], name)
    ]
    if not homes:
        return seen, ()
    tops = None if whole is None else {_top(seen[m.source], names) for m in whole.matches} - {""}
    within = [n for n in homes if whole is not None and _home(whole, seen, n)]
    mine = within[0] if within else homes[0] if tops is None or len(tops) > 1 else ""
    others = [n for n in homes if not mine or not f"{n}/".startswith(f"{mine}/")]
    rest = {_top(one, names) for one in seen} - {
        "",
        *others,
        *(name for name in names if f"{mine}/".startswith(f"{name}/")),
    }
    return (parts[mine] if mine else seen), _told(mine, others, sorted(rest) if mine else [])


def _told(mine: str, others: Sequence[str], rest: Sequence[str]) -> tuple[str, ...]:
    """What other namespaces hold: whole machines, and less."""
    where = f"the channels are those of {mine}; " if mine else ""
    whole = [f"{where}{', '.join(others)} holds all of them as well: --namespace {others[0]} takes "
             "these"] if others else []  # fmt: skip
    part = [f"{where}not all of them are in {', '.join(rest)}"] if rest else []
    return (*whole, *part)


def _apart(seen: Sequence[Seen]) -> list[str]:
    """The namespaces that hold some topics and not all others that are in any."""
    topics = [one.table.name for one in seen]
    inside = [topic for topic in topics if topic.rfind("/") > 0]
    return [
        name for name in namespaces(topics)
        if not all(topic.startswith(f"{name}/") for topic in inside)
    ]  # fmt: skip


def _in(seen: Seen, name: str) -> bool:
    return seen.table.name.startswith(f"{name}/")


def _home(found: Proposal, seen: Sequence[Seen], name: str) -> bool:
    """Is the whole proposal from the namespace itself?"""
    return all(_in(seen[match.source], name) for match in found.matches)


def _top(seen: Seen, names: Sequence[str]) -> str:
    """The widest namespace that a topic is in; empty for one in none."""
    return min((name for name in names if _in(seen, name)), key=len, default="")


def belonging(found: Proposal, seen: Sequence[Seen]) -> Proposal:
    """A proposal that asks whether a command of one namespace drives what has its pose in another,
    where the motion does not follow it."""
    matches = {match.channel: match for match in found.matches}
    pose = [matches.get(name) for name in _POSE]
    told = [m for m in found.matches if m.channel in (_TURNS, *_GOES)]
    if None in pose or not told or ASK in (m.column for m in matches.values()):
        return found
    names = _apart(seen)
    place = next(m for m in pose if m is not None)
    home = _top(seen[place.source], names)
    away = [m for m in told if _top(seen[m.source], names) not in ("", home)]
    if not home or not away or any(_follows(m, matches, seen).clear for m in away):
        return found
    asked = {
        m.channel: f"does {m.column} drive the machine of {home}, whose motion does not follow it?"
        for m in away
    }
    return replace(found, matches=tuple(
        replace(m, column=ASK, reason=asked[m.channel]) if m.channel in asked else m
        for m in found.matches
    ))  # fmt: skip


def _follows(told: Match, matches: dict[str, Match], seen: Sequence[Seen]) -> Follows:
    """Does the pose move as it is told?"""
    (ta, rate), (tb, x), (_, y), (_, heading) = (
        _values(m, seen) for m in (told, *(matches[name] for name in _POSE))
    )
    if not len(tb) == len(x) == len(y) == len(heading):
        return Follows(0.0, np.inf)
    heading = unwrapped(heading)
    if told.channel == _TURNS:
        return follows(ta, rate, tb, heading)
    steps = np.diff(x) * np.cos(heading[:-1]) + np.diff(y) * np.sin(heading[:-1])
    return follows(ta, rate, tb, np.concatenate([[0.0], np.nancumsum(steps)]))


def _values(match: Match, seen: Sequence[Seen]) -> tuple[Vector, Vector]:
    one = seen[match.source]
    t = np.full(len(one.rows), np.nan) if one.t is None else one.t
    return t, conversion(match.unit)[0] * one.values(match.column)
