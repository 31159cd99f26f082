"""What would look the same as what was learned: said in the reason of a version.

Sensor or machine, that cannot always be told. Then the machine is learned, and its version says
which sensor would have to be off by how much.
"""

from __future__ import annotations

import re

SENSOR, SAME, MORE = "a sensor of ", "would look the same", "would explain more"
"""How a caveat begins and ends."""
OFF = re.compile(r"(?<= that is off by ).+? at (row .+?)(?: \(since (row .+?)\))?(?= would )")
"""What a sensor is off by, at which row, and since which."""


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


def instead(said: str, size: str, before: str) -> str:
    """A caveat with another size, since the row from which on ``before`` was.

    >>> old = "a sensor of p that is off by -3 % at row 9 (since row 5) would look the same"
    >>> new = "a sensor of p that is off by -2 % at row 40 (since row 30) would look the same"
    >>> instead(new, "-4.9 %", old)
    'a sensor of p that is off by -4.9 % at row 40 (since row 5) would look the same'
    """
    old, new = OFF.search(before), OFF.search(said)
    if not (old and new):
        return said
    since = f" (since {old[2]})" if old[2] else ""
    return f"{said[: new.start()]}{size} at {new[1]}{since}{said[new.end() :]}"
