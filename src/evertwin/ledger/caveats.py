"""What would look the same as what was learned: said in the reason of a version.

Sensor or machine, that cannot always be told. Then the machine is learned, and its version says
which sensor would have to be off by how much.
"""

from __future__ import annotations

import re

SENSOR, SAME, MORE = "a sensor of ", "would look the same", "would explain more"
"""How a caveat begins and ends."""
OFF = re.compile(r"(?<= that is off by )(.+?)(?: at (row .+?))?(?: \(since (row .+?)\))?(?= would )")
"""What a sensor is off by, at which row, and since which."""
SIZE = re.compile(r"([+-][\d.]+(?:e[+-]?\d+)?)((?: \S+)?)")
"""A number with its sign, and its unit."""


def caveats_of(reason: str) -> dict[str, str]:
    """What would look the same, in the reason of a version, by channel.

    >>> caveats_of("tuned c; a sensor of pow that is off by +5 kW at row 9 would look the same")
    {'pow': 'a sensor of pow that is off by +5 kW at row 9 would look the same'}
    """
    said = [part for part in in_doubt_of(reason) if part.startswith(SENSOR)]
    return {part.removeprefix(SENSOR).split(" that ")[0]: part for part in said}


def in_doubt_of(reason: str) -> tuple[str, ...]:
    """Every caveat in a reason, also of the meter of an input.

    >>> in_doubt_of("tuned c; a meter of u that is off by +5 % would explain more")
    ('a meter of u that is off by +5 % would explain more',)
    """
    return tuple(part for part in reason.split("; ") if part.endswith((SAME, MORE)))


def added(before: str, said: str) -> str:
    """A caveat of numbers that were learned after others, of which ``before`` was said: what the
    sensor would have to be off by for both, by what it was when none of them was learned.

    >>> old = "a sensor of p that is off by -3 % at row 9 (since row 5) would look the same"
    >>> added(old, "a sensor of p that is off by -2 % at row 40 (since row 30) would look the same")
    'a sensor of p that is off by -4.94 % at row 40 (since row 5) would look the same'
    >>> added(old, "a sensor of p that is off by +1 bar at row 40 would look the same")
    'a sensor of p that is off by -3 % and +1 bar at row 40 (since row 5) would look the same'
    """
    old, new = OFF.search(before), OFF.search(said)
    if not (old and new):
        return said
    by = dict[str, str]()
    for size in (*old[1].split(" and "), *new[1].split(" and ")):
        found = SIZE.fullmatch(size)
        if found is None:
            return said
        by[found[2]] = _sum(by[found[2]], found[1], found[2]) if found[2] in by else found[1]
    size = " and ".join(f"{value}{unit}" for unit, value in by.items())
    at, since = (f" at {new[2]}" if new[2] else "", f" (since {old[3]})" if old[3] else "")
    return f"{said[: new.start()]}{size}{at}{since}{said[new.end() :]}"


def _sum(old: str, new: str, unit: str) -> str:
    """Shares are one of the other."""
    a, b = float(old), float(new)
    return f"{a + b + a * b / 100.0:+.3g}" if unit == " %" else f"{a + b:+.4g}"
