"""A law's gain that a number of the model stands for is that number's.

Where only their product acts, the gain of a law and a number of the model beneath it, the numbers
of the law are told behind its gain: a wheel that lost nothing, under a dead zone, would have a gain
of 0.75 times 1.24 and start 24 % late. With the law's gain at 1 each number is the machine's.

>>> import numpy as np
>>> from evertwin.correction.evidence import gather
>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> from evertwin.models.form import Term
>>> u = np.repeat(np.random.default_rng(0).uniform(0.0, 0.2, 60), 5)
>>> rows = make_block(t=np.arange(300) * 10**9, u=u[:, None], y=u.cumsum()[:, None])
>>> stack = Stack(Robot1D(), (0.5,)).plus(Term("law", "v"), (2.0, -0.1, 0.2))
>>> found, names = absorbed(stack, (0,), ("gain",), gather(stack.model, (rows,), 5.0, p=stack.p))
>>> found.p.tolist(), names
([1.0, 1.0, -0.05, 0.1], ('law.v.gain',))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.correction.evidence import Evidence, mean_deviation
from evertwin.correction.numbers.fitting import settled
from evertwin.correction.stack import Stack

PROBED = 1.05
"""Gain that is tried where a law has none."""
SAME = 1e-3
"""Residuals that differ by no more than this share of what the gain moves them are the same."""


def plainest(
    stack: Stack, parts: Sequence[int], numbers: Sequence[str], evidence: Evidence
) -> tuple[Stack, tuple[str, ...]]:
    """`absorbed`, once what changes nothing is neutral, without the parts that are all neutral."""
    settle = settled(stack, parts, evidence)
    found, taken = absorbed(settle, parts, numbers, evidence)
    return _acting(found, parts), taken


def absorbed(
    stack: Stack, parts: Sequence[int], numbers: Sequence[str], evidence: Evidence
) -> tuple[Stack, tuple[str, ...]]:
    """The stack with the gains of its parts in ``numbers`` of the base model, and which these are.

    Args:
        stack: fitted.
        parts: that are new.
        numbers: of the base model that may be tuned.
        evidence: that the stack was fitted to.
    """
    names = list[str]()
    for k in parts:
        part = stack.parts[k]
        local = [one.name for one in part.kind.parameters(part.term, "1", "1")]
        if part.kind.gain not in local:
            continue
        at = local.index(part.kind.gain)
        gain, name = part.values[at], stack.model.parameters.names[stack.first(k) + at]
        if neutral := gain == 1.0:  # is it the number's, too, once it is another one?
            gain = PROBED
        asked = (*part.values[:at], gain, *part.values[at + 1 :])
        values = part.kind.behind_gain(part.term, asked)
        if values == asked:
            continue
        whole, bare = (
            replace(stack, parts=(*stack.parts[:k], replace(part, values=v), *stack.parts[k + 1 :]))
            for v in (asked, values)
        )
        for number in numbers:
            place = stack.base.parameters.index(number)
            inner = list(stack.inner)
            inner[place] *= gain
            item = stack.base.parameters[number]
            taken = replace(bare, inner=tuple(inner))
            if item.low <= inner[place] <= item.high and _same(whole, taken, bare, evidence):
                names.append(name)
                stack = stack if neutral else taken
                break
    return stack, tuple(names)


def _same(stack: Stack, taken: Stack, bare: Stack, evidence: Evidence) -> bool:
    """Does it predict the same, where the gain alone makes a difference?"""
    e, same, without = (evidence.residual(one.model, one.p) for one in (stack, taken, bare))
    moved, off = (mean_deviation(evidence.deviations(r - e)) for r in (without, same))
    return bool(np.isfinite(off) and off <= SAME * moved)


def _acting(stack: Stack, parts: Sequence[int]) -> Stack:
    """Without those of these parts whose numbers are all neutral."""
    neutral = stack.model.parameters.values
    for k in sorted(parts, reverse=True):
        own = slice(stack.first(k), stack.first(k) + len(stack.parts[k].values))
        if np.array_equal(stack.p[own], neutral[own]):
            stack, neutral = stack.without(k), np.delete(neutral, own)
    return stack
