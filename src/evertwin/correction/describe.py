"""A stack of terms in plain words: what the machine does with its commands.

>>> from evertwin.machines.mobile import Robot1D
>>> from evertwin.models.form import Term
>>> law = Term("law", "v", variant="dead zone")
>>> describe(Stack(Robot1D(), (1.0,)).plus(law, (0.06, 0.97, 0.0, 0.16)))
('v: start threshold 0.06 m/s (dead zone), gain 0.97, saturation at 0.16 m/s',)
"""

from __future__ import annotations

import math

from evertwin.correction.stack import Part, Stack
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.terms.contract import Intervals

NEAR = 1e-6
"""Share of what was sought that is next to its end."""


def describe(stack: Stack, intervals: Intervals | None = None) -> tuple[str, ...]:
    """One sentence per term; quantities in SI.

    Args:
        intervals: 95 % intervals by the full names of the stack's parameters.
    """
    known, said, model = intervals or {}, [], stack.model
    for k, part in enumerate(stack.parts):
        assert isinstance(model, Corrected)
        names = zip(model.names_of(k), model.local_names_of(k), strict=True)
        local = {own: known[name] for name, own in names if name in known}
        unit = part.kind.unit(part.term, stack.base)
        said.append(part.kind.say(part.term, part.values, unit, local) + _ends(part))
    return tuple(said)


def _ends(part: Part) -> str:
    """Which numbers lie where their search ended: the machine's may lie beyond."""
    items = part.kind.parameters(part.term, "1", "1")
    ends = [
        item.name
        for item, value, low, high in zip(items, part.values, part.low, part.high, strict=False)
        if value != item.value and min(value - low, high - value) <= NEAR * (high - low) < math.inf
    ]
    if not ends:
        return ""
    if all(name.isdigit() for name in ends):  # levels of a table, which only have numbers
        return f", {len(ends)} of them where the search ended: what is true may lie beyond"
    return f", {' and '.join(ends)} where the search ended: it may lie beyond"
