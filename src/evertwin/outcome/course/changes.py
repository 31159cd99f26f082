"""What one version has otherwise than that before it: names with old and new values, those that
moved most first."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from evertwin.correction.describe import describe
from evertwin.correction.stack import stack_of
from evertwin.fold import Event
from evertwin.ledger.versions import Versions
from evertwin.models.corrected.corrected import Corrected, build
from evertwin.models.form import Version
from evertwin.outcome.open.on_trial import shorter
from evertwin.setup.setup import Setup
from evertwin.tuning.posing.recordings import initials

FEW = 3
"""Numbers that are told one by one."""

Move = tuple[str, float, float]
"""Name, value before, value now."""


def changes(setup: Setup, versions: Sequence[Version], events: Sequence[Event] = ()) -> str:
    """What is other in the live version, the first, than in the last of ``versions``, by way of
    those between them, or than was configured: of many numbers those that moved most, by their
    intervals where ``events`` have a fit's; where a state begins is none of the machine's."""
    champion = versions[0]
    tuned, *terms = champion.reason.split("; ")
    names = [name.removesuffix(" (weak)") for name in tuned.removeprefix("tuned ").split(", ")]
    found = _found(setup, champion, versions[-1])
    if found.keys() & set(names) or not terms:  # of a term that came on the way it says nothing
        names = [name for name in names if name not in found]
        terms = [*dict.fromkeys(found.values()), *terms]
    old = {item.name: item.value for item in setup.model.parameters}
    for before in versions[1:]:
        old |= zip(before.names, before.values, strict=True)
    now = dict(zip(champion.names, champion.values, strict=True))
    units = {item.name: item.unit for item in build(setup.model, champion.form).parameters}
    if not tuned.startswith("tuned ") or not set(names) <= set(now) & set(old) & set(units):
        return shorter(champion.reason)
    between = [dict(zip(one.names, one.values, strict=True)) for one in versions[1:-1][::-1]]
    more = [name for name in units if name in now.keys() & old.keys() and any(
        one.get(name, old[name]) != old[name] for one in between)]  # fmt: skip
    names += [name for name in more if name not in names]
    names = [name for name in names if name not in initials(setup.model)] or names
    weak = [name.removesuffix(" (weak)") for name in tuned.split(", ") if name.endswith(" (weak)")]
    moves = [(name, old[name], now[name]) for name in names]
    steps = {name: [one.get(name, old[name]) for one in between] for name in names}
    told = in_words(moves, units, _halves(now, events), weak, steps, setup.once)
    return "; ".join(one for one in (told, *terms[:FEW]) if one)


def _found(setup: Setup, version: Version, before: Version) -> Mapping[str, str]:
    """The numbers of terms that a version has and one ``before`` had not: by sentences."""
    model = build(setup.model, version.form)
    if not isinstance(model, Corrected):
        return {}
    said = describe(stack_of(setup.model, version.form, version.p))
    return {
        name: sentence
        for part, sentence in zip(model.parts, said, strict=True)
        for name in part.names
        if part.term not in before.form.terms
    }


def in_words(
    moves: Sequence[Move], units: Mapping[str, str], halves: Mapping[str, float],
    weak: Sequence[str] = (), steps: Mapping[str, Sequence[float]] | None = None,
    later: Collection[str] = (),
) -> str:  # fmt: skip
    """Old and new values; ``halves``: half the width of a number's interval, where it is known;
    ``weak``: numbers that come after all others, as those of which no interval is known;
    ``steps``: values on the way from the old to the new one; ``later``: numbers of what the machine
    is built of, which come after what wears and what it carries.

    >>> in_words([("Fc", 12.0, 12.1), ("mass", 80.0, 110.0)], {"mass": "kg", "Fc": "N"}, {})
    'mass 80 → 110 kg, Fc 12 → 12.1 N'
    >>> in_words([("a", 1.0, 9.0)], {"a": "1"}, {}, ["a"])
    'a 1 → 9 (weak)'
    >>> in_words([("k", 0.222, 0.121)], {"k": "1"}, {}, steps={"k": [0.0257]})
    'k 0.222 → 0.0257 → 0.121'
    >>> in_words([("a", 0.0, 9.0), ("b", 0.0, 2.0)], {"a": "1", "b": "1"}, {},
    ...          steps={"a": [9.0], "b": [1.0]})
    'b 0 → 1 → 2, a 0 → 9'
    >>> moves = [("l1.I", 1.0, 9.0), ("Fc1", 8.0, 11.0)]
    >>> in_words(moves, {"l1.I": "kg*m^2", "Fc1": "Nm"}, {}, later=["l1.I"])
    'Fc1 8 → 11 Nm, l1.I 1 → 9 kg*m^2'
    """

    def size(move: Move) -> tuple[bool, bool, float]:
        name, first, now = move
        old = [first, *(steps or {}).get(name, ())][-1]  # what the newest version moved comes first
        half = halves.get(name, math.inf)
        half = half if known and half > 0.0 else max(abs(old), abs(now), 1e-300)
        return name not in weak, name not in later, abs(now - old) / half

    known = any(0.0 < halves.get(name, 0.0) < math.inf for name, *_ in moves)
    most = sorted(moves, key=size, reverse=True)
    told = [
        f"{name} {_way(old, *(steps or {}).get(name, ()), now)} {units[name]}".removesuffix(" 1")
        + (" (weak)" if name in weak else "")
        for name, old, now in most[:FEW]
    ]
    rest = [name for name, *_ in most[FEW:]]
    vague = sum(name in weak for name in rest)
    told += [f"and {len(rest)} more" + (f" ({vague} of them weak)" if vague else "")] * bool(rest)
    return ", ".join(told)


def _way(first: float, *more: float) -> str:
    """Values one after the other, each that is another one than that before it; the first and the
    newest two of many."""
    said = [f"{value:.3g}" for value in (first, *more)]
    way = [one for one, before in zip(said, ["", *said], strict=False) if one != before]
    if len(way) == 1:
        way *= 2
    return " → ".join(way if len(way) <= FEW else [way[0], "…", *way[-2:]])


def _halves(now: Mapping[str, float], events: Sequence[Event]) -> dict[str, float]:
    """Half the widths of the intervals that the newest fit with these values gave."""
    for event in reversed(events):
        fitted: Any = event.evidence.get("parameters") if event.kind == "tuned" else None
        if fitted and all(fitted[n]["value"] == now[n] for n in fitted if n in now):
            return {
                name: (one["interval95"][1] - one["interval95"][0]) / 2
                for name, one in fitted.items() if None not in one["interval95"]
            }  # fmt: skip
    return {}


def spelled(event: Event, setup: Setup, versions: Versions, live: int) -> Event:
    """An event of a fit, or of a switch from version ``live``, with old and new values of what
    moved; any other as it is."""
    if event.kind == "tuned":
        fitted: Any = event.evidence.get("parameters", {})
        own = {name: one for name, one in fitted.items() if name in versions[live].names}
        moves = [(name, one["start"], one["value"]) for name, one in own.items()]
        units = {name: one["unit"] for name, one in fitted.items()}
        halves = _halves({name: now for name, _, now in moves}, [event])
        moved = [move for move in moves if move[1] != move[2]]
        rest = event.reason.split("; ")[1:]
        weak = [name for name, one in own.items() if one["verdict"] != "identifiable"]
        said = "; ".join([f"tuned {in_words(moved, units, halves, weak, later=setup.once)}", *rest])
        return replace(event, reason=said) if moved else event
    if event.kind == "alternates":
        known: Any = event.evidence
        pair = sorted((known["first"], known["second"]), reverse=True)
        said = changes(setup, [versions[number] for number in pair]).split("; ")[0]
        return replace(event, reason=f"{event.reason}: {said}")
    if event.kind != "promoted":
        return event
    number: Any = event.evidence["version"]
    new, old = versions[number], versions[live]
    evidence = {**event.evidence, "replaced": live}
    again = "the machine is again as it was then, as after a repair"
    first = number > live and "again" not in evidence
    said = changes(setup, (new, old)) if first else again
    return replace(event, reason=f"{event.reason}; {said}", evidence=evidence)
