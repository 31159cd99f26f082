"""Names of columns: the unit in a heading, the nearest name for a message.

>>> split_unit("q1 [rad]"), split_unit("Force (N)"), split_unit("q[0]"), split_unit("cycle [1]")
(('q1', 'rad'), ('Force', 'N'), ('q[0]', ''), ('cycle', '1'))
>>> split_unit("flow/(l/min)"), split_unit("p/bar"), split_unit("m/s")
(('flow', 'l/min'), ('p', 'bar'), ('m/s', ''))
>>> closest("heater", ["heater_on", "t1"])
"did you mean 'heater_on'?"
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Sequence

from evertwin.errors import UsageError
from evertwin.signals.units import conversion
from evertwin.sources.columns.slashed import slashed

_BRACKETS = re.compile(r"^(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))$")


def split_unit(heading: str) -> tuple[str, str]:
    """Name and unit of a heading such as ``q1 [rad]``; an empty unit where none is given: a number
    in brackets counts columns, but 1 behind a space is the unit of a pure number."""
    text = heading.strip()
    if "/" in text and (parted := slashed(text)) is not None:
        return parted
    return bracketed(text)


def bracketed(heading: str) -> tuple[str, str]:
    """`split_unit` of a unit in brackets."""
    text = heading.strip()
    found = _BRACKETS.match(text)
    unit = ((found[2] or found[3] or "") if found else "").strip()
    if not found or (unit.isdigit() and not text.endswith((" [1]", " (1)"))):
        return text, ""
    return found[1].strip(), unit


def unit_problem(unit: str) -> str:
    """Why a unit that a file states cannot be converted; empty where it can, or where none is.

    >>> unit_problem("cm"), unit_problem("ticks")[:26]
    ('', "'ticks' is not known; writ")
    """
    try:
        conversion(unit or "1")
    except UsageError as error:
        return str(error).removeprefix("unit: ")
    return ""


def closest(name: str, known: Sequence[str]) -> str:
    """The phrase that helps after a wrong name.

    >>> closest("Pressure_A", ["Pressure_B_bar", "Pressure_A_bar"])
    "did you mean 'Pressure_A_bar'?"
    """
    lower = {k.lower(): k for k in known}
    begin = [k for k in lower if name and k.startswith(name.lower())]
    near = begin or difflib.get_close_matches(name.lower(), lower, n=1, cutoff=0.5)
    if near:
        return f"did you mean {lower[near[0]]!r}?"
    shown = ", ".join(known[:12])
    return f"there is {shown}{', …' if len(known) > 12 else ''}" if known else "there is none"


def listed(items: Sequence[str], most: int = 5) -> str:
    """The first items of a list for a message, each of bounded length.

    >>> listed(["a", "b", "c"], most=2)
    'a; b; … (3 in all)'
    """
    shown = [item if len(item) <= 80 else f"{item[:77]}..." for item in items[:most]]
    return "; ".join([*shown, *([f"… ({len(items)} in all)"] if len(items) > most else [])])


def distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Names made distinct: the second ``x`` becomes ``x~2``; an empty one its position.

    >>> distinct(["x", "", "x"])
    ('x', 'c2', 'x~2')
    """
    filled = [name or f"c{i + 1}" for i, name in enumerate(names)]
    seen: Counter[str] = Counter()
    out = []
    for name in filled:
        seen[name] += 1
        out.append(name if seen[name] == 1 else f"{name}~{seen[name]}")
    return tuple(out)


PERIODS = {"ts", "dt", "t_s", "sampling_time", "sample_time"}
RATES = {"fs", "f_s", "sampling_rate", "sample_rate", "samplerate", "sampling_frequency"}
"""Names of one number: seconds from row to row, or rows in a second."""


def samples(name: str) -> bool:
    """Does a number of this name, or path, say how often rows come?

    >>> samples("dataset.fs"), samples("force")
    (True, False)
    """
    return name.rpartition(".")[2].lower() in PERIODS | RATES


def sampled(name: str, value: float) -> float | None:
    """Seconds from row to row, as a number of this name says; None: it does not.

    >>> sampled("Ts", 4.0), sampled("fs", 50.0), sampled("u", 1.0)
    (4.0, 0.02, None)
    """
    if not (samples(name) and value > 0.0):
        return None
    return value if name.rpartition(".")[2].lower() in PERIODS else 1.0 / value
