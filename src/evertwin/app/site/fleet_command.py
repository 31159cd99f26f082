"""What ``evertwin fleet …`` does: it speaks with the shared store, and needs no node to answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from evertwin.app.console import show
from evertwin.errors import UsageError, nearest
from evertwin.fleet import Members, fleet_told
from evertwin.fleet.tenure import ANEW
from evertwin.service.site.site_plan import Site, read_site
from evertwin.store import SqlOwners
from evertwin.store.postgres.database import Postgres


@contextmanager
def _fleet(site: Path) -> Iterator[tuple[Site, SqlOwners, Members]]:
    """What the site file names.

    Raises:
        UsageError: it names no shared store.
    """
    found = read_site(site)
    server = found.spec.fleet.store
    if not server:
        raise UsageError(f"{site}: [fleet] store: expected a server that the nodes share")
    with closing(Postgres(server)) as database:
        yield found, SqlOwners(database), Members(database)


def show_fleet(site: Path, as_json: bool) -> None:
    """``evertwin fleet status``."""
    with _fleet(site) as (file, owners, members):
        pins = {plan.name: plan.entry.node for plan in file.twins}
        found = fleet_told(owners, members, file.spec.fleet.lease, pins)
    lines = []
    for node in found["nodes"]:
        state = "drains" if node["drains"] else "alive" if node["alive"] else "gone"
        lines.append(f"{node['node']:<16} {state:<7} {node['twins']:>3} twins  "
                     f"{node['cost']:>6.2f} s/s  {node['address']}")  # fmt: skip
    for twin in found["twins"]:
        where = twin["node"] if twin["state"] == "owned" else f"({twin['state']})"
        age = "" if twin["age"] is None else f"lease {twin['age']:.1f} s old  "
        lag = "" if twin["lag"] is None else f"lag {twin['lag']:.3f} s  "
        wish = f"wanted at {twin['wanted']}  " if twin["wanted"] else ""
        lines.append(f"  {twin['twin']:<16} {where:<16} {age}{lag}{wish}{twin['reason']}".rstrip())
    show(found, "\n".join(lines) or "no node yet", as_json)


def move_twin(site: Path, twin: str, node: str, anew: bool = False) -> None:
    """``evertwin fleet move``.

    Args:
        site: file.
        twin: name.
        node: where to; empty: anywhere.
        anew: also where the node has to fold it from its first sample.

    Raises:
        UsageError: no such twin, or node; or this node cannot go on with it.
    """
    with _fleet(site) as (file, owners, members):
        names = [one.node for one in members.all()]
        if node and node not in names:
            raise UsageError(f"no node {node!r}; {nearest(node, names)}")
        pins = {plan.name: plan.entry.node for plan in file.twins}
        if node and pins.get(twin) not in (None, "", node):
            raise UsageError(f"{twin}: the site file pins it to {pins[twin]}: change it there")
        for one in members.said():
            if (one.node, one.twin) == (node, twin) and one.reason and not anew:
                raise UsageError(
                    f"{node} cannot go on with {twin}: {one.reason}: mend that and reload the node "
                    "(--anew: it is to try, from the first sample if need be)"
                )
        if not owners.want(twin, node + ANEW if node and anew else node):
            known = [one.twin for one in owners.held()]
            raise UsageError(f"no twin {twin!r}; {nearest(twin, known)}")


def drain_node(site: Path, node: str, drains: bool) -> None:
    """``evertwin fleet drain``.

    Raises:
        UsageError: no such node.
    """
    with _fleet(site) as (_, _, members):
        if not members.drain(node, drains):
            names = [one.node for one in members.all()]
            raise UsageError(f"no node {node!r}; {nearest(node, names)}")
