"""Numbers that no slope of the cost leads to, such as where a dead zone ends, sought by steps.

Each is moved by a considerable change, then by ever less. Of a stretch on which all are alike it is
the middle: within a gap of the commands no number is better, and what comes next lies on either
side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from evertwin.correction.evidence import Evidence
from evertwin.correction.stack import Stack

SHARES = (1.0, 0.5, 0.2, 0.1)
"""Of a considerable change, by which such a number is moved."""
STRETCH = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
"""Of it, up to which the cost is looked at on either side."""
ROUNDS, MOVES = 3, 4
"""How often all of them are moved, and each one by a share, at most."""
LESS = 1e-4
"""Share by which the cost has to fall, or may rise where it is alike."""


def cost_of(evidence: Evidence, stack: Stack) -> float:
    """Σ soft_l1 of the residuals, as SciPy counts it."""
    residual = evidence.residual(stack.model, stack.p)
    return float(np.sum(np.sqrt(1.0 + residual**2) - 1.0))


def slid(
    stack: Stack, parts: Sequence[int], evidence: Evidence, anew: Callable[[Stack], Stack],
    shares: Sequence[float] = SHARES,
) -> Stack:  # fmt: skip
    """A stack with such numbers of some parts where they are best beside the others.

    Args:
        anew: fits the other numbers, once these have moved.
        shares: of a considerable change, by which each is moved.
    """
    places = tuple(_places(stack, parts))
    for _ in range(ROUNDS if places else 0):
        best = stack
        for share in shares:
            best = _pushed(best, places, share, evidence)
        if best is stack:
            break
        stack = anew(best)
    for place in places:
        stack = _centred(stack, place, evidence)
    return stack


def _places(stack: Stack, parts: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Part and place of each such number."""
    for k in parts:
        part = stack.parts[k]
        names = [one.name for one in part.kind.parameters(part.term, "1", "1")]
        yield from ((k, i) for i in part.fixed if names[i] in part.kind.slopeless)


def _moved(stack: Stack, place: tuple[int, int], share: float) -> Stack:
    """With one of them moved by a share of a considerable change, within its bounds."""
    (k, i), p = place, stack.p
    part, at = stack.parts[k], stack.first(k) + i
    p[at] = min(max(p[at] + share * part.typical[i], part.low[i]), part.high[i])
    return stack.with_p(p)


def _pushed(
    best: Stack, places: Sequence[tuple[int, int]], share: float, evidence: Evidence
) -> Stack:
    """Each of them moved to and fro by this share, while it helps."""
    least = cost_of(evidence, best)
    for place in places:
        for step in (share, -share):
            for _ in range(MOVES):
                moved = _moved(best, place, step)
                cost = cost_of(evidence, moved)
                if not cost < (1.0 - LESS) * least:
                    break
                best, least = moved, cost
    return best


def _centred(stack: Stack, place: tuple[int, int], evidence: Evidence) -> Stack:
    """With one of them in the middle of the stretch about it on which the cost is alike."""
    most, ends = (1.0 + LESS) * cost_of(evidence, stack), list[float]()
    for sign in (-1.0, 1.0):
        ends.append(0.0)
        for share in STRETCH:
            if cost_of(evidence, _moved(stack, place, sign * share)) > most:
                break
            ends[-1] = sign * share
    return _moved(stack, place, 0.5 * sum(ends))
