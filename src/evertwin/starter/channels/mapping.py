"""A proposal for a kind of machine: which of its looks applies.

>>> import tempfile
>>> from pathlib import Path
>>> from evertwin.machines.catalog import machine
>>> from evertwin.starter.looks.seen import look
>>> file = Path(tempfile.mkdtemp()) / "run.csv"
>>> _ = file.write_text("time [s],forward velocity [cm/s],x [cm]\\n0,10,0\\n0.1,12,1\\n0.2,11,2\\n")
>>> match = mapped(machine("robot1d", {}), look([file])[0]).matches[0]
>>> match.channel, match.column, match.unit
('v', 'forward velocity', 'cm/s')
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evertwin.errors import DataError
from evertwin.machines.arm import Arm
from evertwin.models import Model
from evertwin.signals import Channel, conversion
from evertwin.sources.columns.description import ColumnInfo
from evertwin.sources.columns.names import listed, unit_problem
from evertwin.starter.channels.arm import of_arm
from evertwin.starter.channels.bare import restored, told_apart
from evertwin.starter.channels.base import SIDES, of_odometry, of_pose, of_wheels
from evertwin.starter.channels.cause import NAMED, stepped, told
from evertwin.starter.channels.compass import as_compass
from evertwin.starter.channels.named import matched, short, sole, unit_of
from evertwin.starter.channels.turning import as_turned
from evertwin.starter.looks.relations import wraps
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import (
    AMBIENT,
    HEATER,
    is_temperature,
    quantity,
    role,
    same_kind,
    words,
)
from evertwin.starter.proposal import ASK, Derivation, Match, Proposal

FAR = 3.0
"""So many times as far as the air around it what is heated moves at least."""


def mapped(model: Model | None, seen: Sequence[Seen]) -> Proposal:
    """Columns for the channels of ``model``; None: a model of one's own, by what varies first.

    Raises:
        DataError: there are fewer than two columns of numbers for a model of one's own.
    """
    seen, full = told_apart(seen)
    return restored(_mapped(model, seen), full)


def _mapped(model: Model | None, seen: Sequence[Seen]) -> Proposal:
    if model is None:
        own = _first_two(seen)
        return _rest((*own, *_beside(own, seen)), (), (), seen)
    channels = (*model.inputs, *model.outputs)
    if isinstance(model, Arm):
        found = of_arm(channels, model.chain.joints, seen)
        matches, derived = list(found.matches), list(found.derivations)
    else:
        matches, derived = _other(channels, model.inputs.names if len(model.states) else (), seen)
    matches = as_compass(as_turned(matches, seen), seen)
    derived = _unwrapped(matches, derived, seen)
    return _rest(matches, derived, _lacking(channels, matches, derived), seen)


def _other(
    channels: Sequence[Channel], told: Sequence[str], seen: Sequence[Seen]
) -> tuple[list[Match], list[Derivation]]:
    """By names; what these leave open by wheels, a pose, the steadiest temperature, derivatives."""
    named = [channel for channel in channels if channel.name not in SIDES]
    matches, derived = _one_frame(channels, matched(named, seen, told), seen), list[Derivation]()
    feeds, computed = of_wheels(matches, _lacking(channels, matches, derived), seen)
    matches, derived = [*matches, *feeds], [*derived, *computed]
    feeds, computed = of_pose(_lacking(channels, matches, derived), seen, told)
    matches, derived = [*matches, *feeds], [*derived, *computed]
    matches += of_odometry(matches, _lacking(channels, matches, derived), seen)
    matches = _one_box(matches, seen)
    matches += _heated(_lacking(channels, matches, derived), seen)
    matches += _heater(_lacking(channels, matches, derived), seen)
    matches += _room(matches, _lacking(channels, matches, derived), seen)
    lacking = _lacking(channels, matches, derived)
    taken = {(match.source, match.column) for match in matches}
    matches += sole([c for c in named if c.name in lacking], seen, told, taken)
    matches = _heated_room(matches)
    missing = _lacking(channels, matches, derived)
    place = _place(channels, missing)
    found = matched(place, seen)
    return [*matches, *found], [*derived, *_derivatives((*channels, *place[: len(found)]), missing)]


def _one_frame(
    channels: Sequence[Channel], matches: Sequence[Match], seen: Sequence[Seen]
) -> list[Match]:
    """A pose of one table, where one holds all of it: two may tell it in two frames."""
    pose = [channel for channel in channels if channel.name in ("x", "y", "heading")]
    names = [channel.name for channel in pose]
    sources = [match.source for match in matches if match.channel in names]
    if len(pose) < 3 or len(set(sources)) < 2:
        return list(matches)
    for s in sorted(set(sources), key=lambda s: -sources.count(s)):
        whole = [replace(match, source=s) for match in matched(pose, [seen[s]])]
        if len(whole) == len(pose):
            return [match for match in matches if match.channel not in names] + whole
    return list(matches)


def _lacking(
    channels: Sequence[Channel], matches: Sequence[Match], derived: Sequence[Derivation]
) -> tuple[str, ...]:
    known = {match.channel for match in matches} | {one.name for one in derived}
    return tuple(channel.name for channel in channels if channel.name not in known)


def _rest(
    matches: Sequence[Match], derived: Sequence[Derivation], missing: Sequence[str],
    seen: Sequence[Seen],
) -> Proposal:  # fmt: skip
    used = {(match.source, match.column) for match in matches}
    unused = (c.name for s, one in enumerate(seen) for c in one.columns if (s, c.name) not in used)
    return Proposal(tuple(matches), tuple(derived), tuple(missing), tuple(unused))


def _place(channels: Sequence[Channel], missing: Sequence[str]) -> tuple[Channel, ...]:
    """The position of an axis, of which its speed is the derivative where that is not recorded."""
    units = {channel.name: channel.unit for channel in channels}
    if "speed" not in missing or "position" in units:
        return ()
    return (Channel("position", units["speed"].removesuffix("/s")),)


def _derivatives(channels: Sequence[Channel], missing: Sequence[str]) -> tuple[Derivation, ...]:
    """Speed and acceleration of an axis, where they are not recorded."""
    units = {channel.name: channel.unit for channel in channels}
    return tuple(
        Derivation(name, "derivative", (of,), units[name])
        for of, name in (("position", "speed"), ("speed", "acceleration"))
        if name in missing and of in units and (of not in missing or of == "speed")
    )


def _unwrapped(
    matches: Sequence[Match], derived: Sequence[Derivation], seen: Sequence[Seen]
) -> list[Derivation]:
    """Derivatives of angles that wrap are of what does not."""
    cut = {
        match.channel
        for match in matches
        if match.scale == 1.0 and match.column != ASK and same_kind(match.unit, "rad")
        and wraps(conversion(match.unit)[0] * seen[match.source].values(match.column))
    }  # fmt: skip
    out: list[Derivation] = []
    for one in derived:
        if one.op == "derivative" and one.of[0] in cut:
            whole = f"{one.of[0]}_unwrapped"
            out.append(Derivation(whole, "unwrap", one.of, "rad"))
            one = replace(one, of=(whole,))
        out.append(one)
    return out


def _room(
    matches: Sequence[Match], missing: Sequence[str], seen: Sequence[Seen]
) -> tuple[Match, ...]:
    """The room around a heated box: the steadiest of the other temperatures."""
    box = next((match for match in matches if match.channel == "box"), None)
    if "room" not in missing or box is None:
        return ()
    others = [
        (AMBIENT.isdisjoint(words(column.name)), float(np.nanstd(one.rows[:, i])), s, column)
        for s, one in enumerate(seen)
        for i, column in enumerate(one.columns)
        if is_temperature(column) and HEATER.isdisjoint(words(column.name))
    ]
    others = [
        one for one in others if (one[2], one[3].name) != (box.source, box.column) and one[1] > 0.0
    ]
    if not others:
        return ()
    unnamed, _, s, column = min(others, key=lambda one: one[:3])
    unit, scale, why = unit_of("K", column)
    why = "the steadiest temperature: please check" if unnamed else why
    return (Match("room", s, column.name, column.unit or unit, why, scale),)


def _heated(missing: Sequence[str], seen: Sequence[Seen]) -> tuple[Match, ...]:
    """What is heated: of two temperatures whose words say nothing the one that moves far more; the
    one beside that of the room."""
    could = [
        (float(np.nanstd(one.rows[:, i])), s, column)
        for s, one in enumerate(seen)
        for i, column in enumerate(one.columns)
        if is_temperature(column) and HEATER.isdisjoint(words(column.name))
        and column.low != column.high and role(words(column.name)) not in ("command", "other")
    ]  # fmt: skip
    if "box" not in missing or len(could) != 2:
        return ()
    (little, *_), (much, s, column) = sorted(could, key=lambda one: one[0])
    rooms = [not AMBIENT.isdisjoint(words(one.name)) for *_, one in could]
    why = "the temperature that moves most: please check"
    if any(rooms):
        *_, s, column = could[rooms.index(False)] if not all(rooms) else could[0]
        why = "the temperature beside that of the room: please check"
    if all(rooms) or not (any(rooms) or much > FAR * little):
        return ()
    unit, scale, _ = unit_of("K", column)
    return (Match("box", s, column.name, column.unit or unit, why, scale),)


def _one_box(matches: Sequence[Match], seen: Sequence[Seen]) -> list[Match]:
    """What is heated, asked where several temperatures beside the room's could be it."""
    box = next((match for match in matches if match.channel == "box"), None)
    if box is None:
        return list(matches)
    used = {(m.source, m.column) for m in matches if m is not box}
    could = [
        column.name
        for s, one in enumerate(seen) for column in one.columns
        if is_temperature(column) and column.low != column.high and (s, column.name) not in used
        and (AMBIENT | HEATER).isdisjoint(words(column.name))
        and role(words(column.name)) not in ("command", "other")
    ]  # fmt: skip
    named = not AMBIENT.isdisjoint(w for one in seen for c in one.columns for w in words(c.name))
    if len(could) < 2 or not named or "box" in words(box.column):
        return list(matches)
    why = f"what is heated: {', '.join(could[:4])}?"
    return [replace(m, column=ASK, reason=why) if m is box else m for m in matches]


def _heated_room(matches: Sequence[Match]) -> list[Match]:
    """Of a room and what is around it, the room is what is heated."""
    mine = {match.channel: match for match in matches}
    box, room = mine.get("box"), mine.get("room")
    around = not (AMBIENT - {"room"}).isdisjoint(words(box.column)) if box else False
    if box is None or room is None or not around or "room" not in words(room.column):
        return list(matches)
    why = f"what is heated, and {box.column} is around it: please check"
    moved = {"box": replace(room, channel="box", reason=why), "room": replace(box, channel="room")}
    return [moved.get(match.channel, match) for match in matches]


def _heater(missing: Sequence[str], seen: Sequence[Seen]) -> tuple[Match, ...]:
    """A heater that is recorded in watts: its full power says what 1 is."""
    fits = [
        (s, column)
        for s, one in enumerate(seen) for column in one.columns
        if column.low != column.high and same_kind(column.unit, "W")
    ]  # fmt: skip
    if "heater" not in missing or len(fits) != 1:
        return ()
    ((s, column),) = fits
    why = f"one over the heater's full power in {column.unit}"
    return (Match("heater", s, column.name, "1", why, ASK),)


def _first_two(seen: Sequence[Seen]) -> tuple[Match, ...]:
    """What drives and what answers: by their headings' words, or what moves in steps drives; else
    the first column that varies drives, the next one answers.

    Of more than two columns those that nothing says so of are asked.
    """
    source = max(range(len(seen)), key=lambda s: seen[s].table.rows * len(seen[s].columns))
    columns = list(seen[source].columns)
    if len(columns) < 2:
        raise DataError("expected two columns of numbers beside the time: an input and an output")
    columns.sort(key=lambda c: c.low == c.high)  # what is constant can drive nothing
    moving = [c for c in columns if c.low != c.high]
    beside = {c.name: c.unit for c in columns}
    rank = {c.name: told(c.name, c.unit, beside) if c in moving else 0 for c in columns}
    in_steps = {c.name for c in moving if stepped(seen[source].values(c.name))}
    currents = [n for n in in_steps if quantity(words(n), beside[n]) == "current"]
    if len(currents) == len(in_steps) == 1:  # a current that was set: the voltage answers
        rank |= {n: 0 for n in rank if quantity(words(n), beside[n]) == "voltage"}
    drives = max(columns, key=lambda c: (c in moving, rank[c.name], c.name in in_steps))
    rest = [c for c in columns if c is not drives]
    answers = min(rest, key=lambda c: (c not in moving, rank[c.name], c.name in in_steps))
    unmoved = max(rank.values()) <= 0  # a speed of which nobody says by what may drive
    place = any(words(c.name)[:1] == ["x"] for c in moving)  # beside an x, y is one, too
    both = []
    for name, column, sign in (("u", drives, 1), ("y", answers, -1)):
        mine = sign * rank[column.name]
        alike = [c for c in moving if sign * rank[c.name] >= mine]
        says = mine >= NAMED or (mine > 0 and alike == [column])
        says = says and not (sign < 0 and (place or (unmoved and _moves(column))))
        both.append((name, column, mine, alike, says or len(moving) <= 2))
    taken = {column.name for _, column, _, _, says in both if says}
    out = []
    for name, column, mine, alike, says in both:
        if says:
            why = "assumed: by its words" if mine > 0 else "assumed: by its place"
            if mine <= 0 and len(in_steps) == 1 and rank[drives.name] == rank[answers.name]:
                why = f"assumed: {min(in_steps)} moves in steps, as what is set does"
            out.append(Match(name, source, column.name, _stated(column), why))
        else:
            alike = alike if mine > 0 and len(alike) > 1 else moving
            could = [c.name for c in alike if c.name not in taken]
            which = f"which one {'drives' if name == 'u' else 'answers'}? {listed(could, 4)}"
            out.append(Match(name, source, ASK, "1", which))
    return out[0], _answering(out[1], rank, seen)


def _answering(found: Match, rank: Mapping[str, int], seen: Sequence[Seen]) -> Match:
    """What answers by its words in another table, where no column of the largest one says so."""
    others = [
        (told(c.name, c.unit), s, c)
        for s, one in enumerate(seen) for c in one.columns if s != found.source and c.low != c.high
    ]  # fmt: skip
    least = min((one[0] for one in others), default=0)
    fits = [one for one in others if one[0] == least]
    if least >= min(0, *rank.values()) or len(fits) != 1:
        return found
    _, s, column = fits[0]
    return Match(found.channel, s, column.name, _stated(column), "assumed: by its words")


def _moves(column: ColumnInfo) -> bool:
    return quantity(words(column.name), column.unit) == "velocity"


def _beside(main: Sequence[Match], seen: Sequence[Seen]) -> tuple[Match, ...]:
    """What other tables hold: inputs for a model of one's own, under names of their own."""
    out, names = list[Match](), {match.channel for match in main}
    taken = {(match.source, match.column) for match in main}
    for s, one in enumerate(seen):
        for column in one.columns if s != main[0].source else ():
            if (s, column.name) in taken:
                continue
            name = short(column.name)
            if column.low != column.high and name not in names:
                names.add(name)
                why = "recorded beside: an input of the model, or take it out"
                out.append(Match(name, s, column.name, _stated(column), why))
    return tuple(out)


def _stated(column: ColumnInfo) -> str:
    """The unit that the file states, where it is one."""
    return column.unit if column.unit and not unit_problem(column.unit) else "1"
