"""How a fleet is, in plain values.

>>> from evertwin.store.sql.database import Database
>>> from evertwin.store import SqlOwners
>>> database = Database(":memory:")
>>> owners, members = SqlOwners(database), Members(database)
>>> members.beat("north", "https://192.0.2.1:8700", 10.0), owners.claim("arm", "north", 10.0)
(False, 1)
>>> told = fleet_told(owners, members, 10.0, {"lift": "south"})
>>> told["nodes"][0]["twins"], [(one["twin"], one["state"]) for one in told["twins"]]
(1, [('arm', 'owned'), ('lift', 'waits')])
>>> told["twins"][1]["reason"]
'only south can run it, and is not there'
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from evertwin.fleet.members import Members
from evertwin.fleet.tenure import ANEW, Seen
from evertwin.store.owners.owners import Held, Owners


def fleet_told(
    owners: Owners, members: Members, lease: float, pins: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Nodes and twins of a fleet.

    Args:
        owners: who has which twin.
        members: the nodes.
        lease: seconds that a node's word holds.
        pins: by twin of the site file: the one node that can run it; empty: any.

    Returns:
        ``nodes``: name, address, whether it is alive and drains, twins, their cost [s/s];
        ``twins``: name, node, state (owned, free, waits: no node can go on with it), token, age of
        the lease [s], lag [s], row, where it is wanted, reason (why it does not run, or not move).

    Raises:
        StoreUnwritable: the store cannot be reached.
    """
    every, pins = members.all(), pins or {}
    held = {one: Held(one, 0, "", -1.0) for one in pins} | {o.twin: o for o in owners.held()}
    alive = [one for one in every if one.alive and not one.drains]
    seen = Seen(held, alive, members.said())
    twins = [_twin(held[one], lease, seen, pins.get(one, "")) for one in sorted(held)]
    nodes = []
    for one in every:
        own = [twin for twin in twins if twin["node"] == one.node and twin["state"] == "owned"]
        cost = sum(twin["cost"] or 0.0 for twin in own)
        nodes.append({"node": one.node, "address": one.address, "alive": one.alive,
                      "drains": one.drains, "twins": len(own), "cost": round(cost, 4)})  # fmt: skip
    return {"schema": "evertwin.fleet/1", "lease": lease, "nodes": nodes, "twins": twins}


def _twin(held: Held, lease: float, seen: Seen, pin: str) -> dict[str, Any]:
    said = json.loads(held.told) if held.told else {}
    owned = held.left > 0.0
    waits = _waits(held, seen, pin)
    state = "owned" if owned else "waits" if waits else "free"
    own = str(said.get("reason", "")) if owned else ""
    return {
        "twin": held.twin, "node": held.node, "state": state,
        "token": held.token, "age": round(lease - held.left, 3) if owned else None,
        "lag": said.get("lag"), "row": said.get("row"), "cost": said.get("cost"),
        "wanted": held.wanted.removesuffix(ANEW), "reason": "; ".join(filter(None, (own, waits))),
    }  # fmt: skip


def _waits(held: Held, seen: Seen, pin: str) -> str:
    """Why a twin runs nowhere, or stays where it is not to be; empty: it need not, or will soon."""
    unable = {one.node: one.reason for one in seen.says if one.twin == held.twin and one.reason}
    wish, owner = held.wanted.removesuffix(ANEW), seen.owner(held.twin)
    if pin and owner != pin:
        there = f"and says: {unable[pin]}" if pin in unable else "and is not there"
        return f"only {pin} can run it, {there}" if not seen.may(pin, held.twin) else ""
    if owner and owner in seen.names and (not wish or wish == owner):
        return ""
    cannot = "; ".join(f"{one} cannot: {unable[one]}" for one in sorted(seen.names & set(unable)))
    if owner and wish and wish != owner:
        if wish in seen.names:
            return f"stays: {wish} cannot: {unable[wish]}" if wish in unable else ""
        return f"stays: {wish} is not there" if owner in seen.names else cannot
    if any(seen.may(one, held.twin) for one in seen.names):
        return ""
    if owner:
        return f"stays while {owner} runs: {cannot or 'no other node is there'}"
    return cannot or "no node is there"
