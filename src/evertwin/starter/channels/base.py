"""The channels of a mobile base, where the recording says them in other words.

Two wheels that are commanded give speed and turn rate once their radius and track are known; a pose
gives the way that was travelled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evertwin.signals import Channel, lacks_angle
from evertwin.sources.columns.description import ColumnInfo
from evertwin.starter.channels.named import matched, unit_of
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import WHEEL, role, same_kind, words
from evertwin.starter.proposal import ASK, Answer, Derivation, Match

_POSE = (Channel("x", "m"), Channel("y", "m"), Channel("heading", "rad", kind="angle"))
SIDES = {
    "left": {"left", "l", "links", "li", "gauche"},
    "right": {"right", "r", "rechts", "re", "droite"},
}
TURNS = {"wheel", "track", "motor", "drive", "omega", "speed", "vel", "velocity", "v", "rpm"}
"""Words of what turns on either side."""
_ODOMETRY = {"odom", "odometry", "odo"}


def of_wheels(
    matches: Sequence[Match], missing: Sequence[str], seen: Sequence[Seen]
) -> tuple[tuple[Match, ...], tuple[Derivation, ...]]:
    """Speed ``v`` and turn rate ``w`` of two wheels or tracks, where no column is either, or how
    fast ``left`` and ``right`` turn: of those that are commanded, else of those of which no name
    says whether they are."""
    pair, each = None, SIDES.keys() <= set(missing)
    if "v" in missing or each:
        pair = _pair(matches, seen, "command") or _pair(matches, seen, "")
    if pair is None:
        return (), ()
    (s, left), (other, right) = pair
    unit, reason = _speed(left)
    if role([*words(seen[s].theme), *words(left.name)]) != "command":
        reason = "no name says whether it is told or measured: please check"
    feeds = (
        Match("left", s, left.name, unit, reason), Match("right", other, right.name, unit, reason),
    )  # fmt: skip
    turning = unit != "m/s"
    if each:
        return (feeds if turning else ()), ()
    half: Answer = ASK if turning else 0.5
    derived = [
        Derivation("both", "sum", ("left", "right"), unit),
        Derivation("v", "scale", ("both",), "m/s", half, "half the radius of a wheel [m]"),
    ]
    if "w" in missing:
        across = "the radius of a wheel over the distance of the two" if turning else (
            "one over the distance of the two wheels [1/m]"
        )  # fmt: skip
        derived += [
            Derivation("turning", "difference", ("right", "left"), unit),
            Derivation("w", "scale", ("turning",), "rad/s", ASK, across),
        ]
    return feeds, tuple(derived)


def _pair(
    matches: Sequence[Match], seen: Sequence[Seen], asked: str
) -> tuple[tuple[int, ColumnInfo], ...] | None:
    """Table and column of the left and of the right one, both ``asked`` for by their role."""
    used = {(match.source, match.column) for match in matches}
    sides: dict[str, tuple[int, ColumnInfo]] = {}
    for s, one in enumerate(seen):
        for column in one.columns:
            said = words(column.name)
            side = next((side for side, names in SIDES.items() if names & {*said}), None)
            varies = column.low != column.high and (s, column.name) not in used
            turns = asked == "command" or any(same_kind(column.unit, u) for u in ("m/s", "rad/s"))
            turns |= not column.unit and not TURNS.isdisjoint(said)
            if side and varies and turns and role([*words(one.theme), *said]) == asked:
                sides.setdefault(side, (s, column))
    return tuple(sides[side] for side in SIDES) if len(sides) == len(SIDES) else None


def _speed(column: ColumnInfo) -> tuple[str, str]:
    """Unit of a wheel's speed."""
    for wanted in ("m/s", "rad/s"):
        if column.unit and same_kind(column.unit, wanted) and not lacks_angle(column.unit, wanted):
            return column.unit, "stated by the file"
    unit, _, _ = unit_of("rad/s", column)
    return unit, "assumed: please check"


def of_pose(
    missing: Sequence[str], seen: Sequence[Seen], told: Sequence[str]
) -> tuple[tuple[Match, ...], tuple[Derivation, ...]]:
    """The way ``travel`` of a pose, where no column is it."""
    if "travel" not in missing:
        return (), ()
    found = {match.channel: match for match in matched(_POSE, seen, told)}
    if not {"x", "y"} <= found.keys():
        return (), ()
    heading = "heading" if "heading" in found or "heading" not in missing else None
    if heading is None:
        return (), ()
    way = Derivation("travel", "path", ("x", "y", "heading"), "m")
    return tuple(found[name] for name in ("x", "y")), (way,)


def of_odometry(
    matches: Sequence[Match], missing: Sequence[str], seen: Sequence[Seen]
) -> tuple[Match, ...]:
    """Speed and turn rate that a base says it drove, where no command is recorded and the pose is
    another sensor's: odometry is no evidence of itself, nor is one wheel a base's speed."""
    pose = {m.channel: m for m in matches if m.channel in ("x", "y", "heading")}
    if not {"v", "w"} <= set(missing) or len(pose) < len(_POSE):
        return ()
    if any(not _ODOMETRY.isdisjoint(words(m.column)) for m in pose.values()):
        return ()
    own = tuple(
        replace(one, table=replace(one.table, columns=tuple(
            c for c in one.table.columns if not _ODOMETRY.isdisjoint(words(c.name))
            and WHEEL.isdisjoint(words(c.name))
        )))
        for one in seen
    )  # fmt: skip
    found = matched((Channel("v", "m/s"), Channel("w", "rad/s")), own)
    said = "what the base says it drove, for no command is recorded: please check"
    return tuple(replace(m, reason=said) for m in found) if len(found) > 1 else ()
