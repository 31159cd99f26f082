"""Limits of health beside what their parameters are: what would end a life before it begins.

A limit above the stated value is passed by growth, one below it by a fall
(`evertwin.prognosis.outlook.limits.breakdown_limits`).
"""

from __future__ import annotations

from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.choice import Chosen
from evertwin.tuning import Problem


def limits_against_values(breakdown: Breakdown, chosen: Chosen, problem: Problem) -> list[str]:
    """What is said of limits: which are passed already, which by a fall, which nothing follows.

    Args:
        breakdown: the file.
        chosen: with the values that a first fit found.
        problem: on the parameters that the model knows.
    """
    known = {item.name: item for item in problem.parameters.items}
    found = {one.name: one for one in chosen.choices}
    notes = []
    for stated in breakdown.stated:
        limit, choice = stated.said.limit, found.get(stated.name)
        if limit is None or choice is None or stated.name not in known:
            continue
        item = known[stated.name]
        begun = item.value if stated.said.value is None else stated.said.value
        now = item.value if choice.value is None else choice.value
        side = 1.0 if limit >= begun else -1.0
        at = f"its limit of health {limit:.4g} {item.unit}"
        if side * (now - limit) >= 0.0:
            notes.append(f"{stated.name} is {now:.4g} {item.unit}, beyond {at}: its life is over "
                         "now; correct the limit, or the value")  # fmt: skip
        elif side < 0.0:
            notes.append(f"{stated.name} is {now:.4g} {item.unit}, {at} lies below: it wears by a "
                         "fall; if it grows, correct the limit")  # fmt: skip
        if not choice.editable:
            notes.append(f"{stated.name} is not tuned, nothing follows {at}")
    return notes
