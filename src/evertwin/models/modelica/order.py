"""Which equation gives which variable, and in which order (matching and strongly connected parts).

>>> matched([{0, 1}, {0}], 2)
([1, 0], [])
>>> ordered([{0}, {0, 1}], [0, 1])
[[0], [1]]
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["matched", "ordered"]


def matched(uses: Sequence[set[int]], unknowns: int) -> tuple[list[int], list[int]]:
    """The unknown of each equation, (equations,), −1 for none; and, where one has none, equations
    that have too few unknowns among them.

    Args:
        uses: unknowns that each equation contains.
        unknowns: how many there are.
    """
    owner = [-1] * unknowns
    bound: list[int] = []
    for equation in range(len(uses)):
        seen: set[int] = set()
        if not _augment(equation, uses, owner, seen) and not bound:
            bound = sorted({equation, *(owner[u] for u in seen if owner[u] >= 0)})
    out = [-1] * len(uses)
    for unknown, equation in enumerate(owner):
        if equation >= 0:
            out[equation] = unknown
    return out, bound


def _augment(start: int, uses: Sequence[set[int]], owner: list[int], seen: set[int]) -> bool:
    """A path of reassignments that ends at a free unknown, searched breadth first."""
    came: dict[int, int] = {}
    queue = [start]
    for equation in queue:
        for unknown in sorted(uses[equation]):
            if unknown in seen:
                continue
            seen.add(unknown)
            came[unknown] = equation
            if owner[unknown] < 0:
                while True:
                    give = came[unknown]
                    previous = next((u for u, e in enumerate(owner) if e == give), -1)
                    owner[unknown] = give
                    if give == start:
                        return True
                    unknown = previous
            queue.append(owner[unknown])
    return False


def ordered(uses: Sequence[set[int]], gives: Sequence[int]) -> list[list[int]]:
    """Groups of equations, in an order in which each needs only what earlier ones give (Tarjan).

    Args:
        uses: unknowns that each equation contains.
        gives: the unknown that each equation is matched with.
    """
    owner = {unknown: equation for equation, unknown in enumerate(gives)}
    needs = [sorted({owner[u] for u in used} - {e}) for e, used in enumerate(uses)]
    number: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    groups: list[list[int]] = []
    for root in range(len(uses)):
        if root in number:
            continue
        work = [(root, iter(needs[root]))]
        number[root] = low[root] = len(number)
        stack.append(root)
        while work:
            at, rest = work[-1]
            after = next(rest, None)
            if after is None:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[at])
                if low[at] == number[at]:
                    cut = stack.index(at)
                    groups.append(sorted(stack[cut:]))
                    del stack[cut:]
            elif after not in number:
                number[after] = low[after] = len(number)
                stack.append(after)
                work.append((after, iter(needs[after])))
            elif after in stack:
                low[at] = min(low[at], number[after])
    return groups
