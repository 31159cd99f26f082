"""Which equation gives which unknown, and in which order.

A matching gives each equation one unknown; the strongly connected parts of what each needs are the
smallest systems that must be solved together, and they can be solved one after the other.

>>> matched([{0, 1}, {1}], 2)
([0, 1], [])
>>> ordered([{0, 1}, {1}], [0, 1])
[[1], [0]]
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
import scipy


def _graph(pairs: Iterable[tuple[int, int]], rows: int, columns: int) -> Any:
    places = np.array(sorted(pairs), dtype=np.int32).reshape(-1, 2)
    ones = np.ones(len(places), dtype=np.int8)
    return scipy.sparse.csr_array((ones, (places[:, 0], places[:, 1])), shape=(rows, columns))


def matched(uses: Sequence[set[int]], unknowns: int) -> tuple[list[int], list[int]]:
    """(unknown of each equation, −1: none; equations that share too few unknowns).

    Args:
        uses: unknowns that occur in each equation, by number.
        unknowns: how many there are.
    """
    if not uses or not unknowns:
        return [-1] * len(uses), list(range(len(uses)))[:1]
    graph = _graph(((e, u) for e, used in enumerate(uses) for u in used), len(uses), unknowns)
    gives = scipy.sparse.csgraph.maximum_bipartite_matching(graph, "column").tolist()
    owner = {unknown: equation for equation, unknown in enumerate(gives) if unknown >= 0}
    bound: set[int] = set()
    more = {gives.index(-1)} if -1 in gives else set()
    while not more <= bound:  # all that an equation without an unknown would have to take one from
        bound |= more
        more = {owner[unknown] for equation in bound for unknown in uses[equation]}
    return gives, sorted(bound)


def ordered(uses: Sequence[set[int]], gives: Sequence[int]) -> list[list[int]]:
    """Equations in groups that must be solved together, each after those it needs.

    Args:
        uses: unknowns that occur in each equation.
        gives: the unknown that each equation gives.
    """
    owner = {unknown: equation for equation, unknown in enumerate(gives)}
    needs = {(e, owner[u]) for e, used in enumerate(uses) for u in used}
    graph = _graph(needs, len(uses), len(uses))
    _, group = scipy.sparse.csgraph.connected_components(graph, connection="strong")
    before: dict[int, set[int]] = {int(one): set() for one in group}
    for equation, other in needs:
        if group[equation] != group[other]:
            before[int(group[equation])].add(int(group[other]))
    turns = TopologicalSorter(before).static_order()
    return [np.flatnonzero(group == one).tolist() for one in turns]
