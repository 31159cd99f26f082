"""Which twins go from the busiest node to the least busy one, so that both are busy alike.

Busy is what twins cost, in seconds of work a second. A twin goes only if the node that it leaves
stays at least as busy as the one that it comes to: so no twin comes back for what it has moved.

>>> costs = {"arm": ("north", 0.3), "cart": ("north", 0.2), "lift": ("north", 0.1)}
>>> uneven(costs, ("north", "south"))
Uneven(busy='north', idle='south', twins=('arm', 'cart', 'lift'))
>>> uneven(costs | {"arm": ("south", 0.3)}, ("north", "south")).twins
()
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

GAP = 0.1
"""Seconds of work a second between two nodes that are not worth a move."""
SHARE = 0.25
"""Share of the busiest node's work that is not either."""


class Uneven(NamedTuple):
    """What could go where.

    >>> Uneven().twins
    ()
    """

    busy: str = ""
    idle: str = ""
    twins: tuple[str, ...] = ()
    """The one that evens most first."""


def loads(costs: Mapping[str, tuple[str, float]], nodes: Iterable[str]) -> dict[str, float]:
    """Seconds of work a second of each node.

    Args:
        costs: by twin: its node, and what it costs.
        nodes: those that count.
    """
    found = dict.fromkeys(nodes, 0.0)
    for node, cost in costs.values():
        if node in found:
            found[node] += cost
    return found


def uneven(
    costs: Mapping[str, tuple[str, float]], nodes: Iterable[str], fixed: Iterable[str] = ()
) -> Uneven:
    """What could go from the busiest node to the least busy one; nothing where it is not worth it.

    Args:
        costs: by twin that is owned: its node, and what it costs [s/s].
        nodes: those that may take twins.
        fixed: twins that stay where they are.
    """
    load = loads(costs, sorted(nodes))
    if len(load) < 2:
        return Uneven()
    busy, idle = max(load, key=load.__getitem__), min(load, key=load.__getitem__)
    gap = load[busy] - load[idle]
    if gap <= max(GAP, SHARE * load[busy]):
        return Uneven(busy, idle)
    stays = set(fixed)
    movable = {
        twin: cost for twin, (node, cost) in costs.items()
        if node == busy and twin not in stays and 0.0 < cost <= gap / 2.0
    }  # fmt: skip
    return Uneven(busy, idle, tuple(sorted(movable, key=lambda one: (-movable[one], one))))
