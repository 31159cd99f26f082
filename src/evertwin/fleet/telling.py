"""How a fleet is, in plain values.

>>> from evertwin.store.database import Database
>>> from evertwin.store import SqlOwners
>>> database = Database(":memory:")
>>> owners, members = SqlOwners(database), Members(database)
>>> members.beat("north", "https://192.0.2.1:8700", 10.0), owners.claim("arm", "north", 10.0)
(False, 1)
>>> told = fleet_told(owners, members, 10.0)
>>> told["nodes"][0]["twins"], told["twins"][0]["state"]
(1, 'owned')
"""

from __future__ import annotations

import json
from typing import Any

from evertwin.fleet.members import Members
from evertwin.store.owners import Held, Owners


def fleet_told(owners: Owners, members: Members, lease: float) -> dict[str, Any]:
    """Nodes and twins of a fleet.

    Args:
        owners: who has which twin.
        members: the nodes.
        lease: seconds that a node's word holds.

    Returns:
        ``nodes``: name, address, whether it is alive and drains, twins, their cost [s/s];
        ``twins``: name, node, state (owned, free), token, age of the lease [s], lag [s], row,
        reason (why its node does not run it).

    Raises:
        StoreUnwritable: the store cannot be reached.
    """
    twins = [_twin(one, lease) for one in owners.held()]
    nodes = []
    for one in members.all():
        own = [twin for twin in twins if twin["node"] == one.node and twin["state"] == "owned"]
        cost = sum(twin["cost"] or 0.0 for twin in own)
        nodes.append({"node": one.node, "address": one.address, "alive": one.alive,
                      "drains": one.drains, "twins": len(own), "cost": round(cost, 4)})  # fmt: skip
    return {"schema": "evertwin.fleet/1", "lease": lease, "nodes": nodes, "twins": twins}


def _twin(held: Held, lease: float) -> dict[str, Any]:
    said = json.loads(held.told) if held.told else {}
    owned = held.left > 0.0
    return {
        "twin": held.twin, "node": held.node, "state": "owned" if owned else "free",
        "token": held.token, "age": round(lease - held.left, 3) if owned else None,
        "lag": said.get("lag"), "row": said.get("row"), "cost": said.get("cost"),
        "wanted": held.wanted, "reason": said.get("reason", ""),
    }  # fmt: skip
