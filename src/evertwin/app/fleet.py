"""What ``evertwin fleet …`` does: it speaks with the shared store, and needs no node to answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from evertwin.app.console import show
from evertwin.errors import UsageError, nearest
from evertwin.fleet import FleetSpec, Members, fleet_told
from evertwin.service.plan import read_site
from evertwin.store import SqlOwners
from evertwin.store.postgres import Postgres


@contextmanager
def _fleet(site: Path) -> Iterator[tuple[FleetSpec, SqlOwners, Members]]:
    """What the site file names.

    Raises:
        UsageError: it names no shared store.
    """
    spec = read_site(site).spec.fleet
    if not spec.store:
        raise UsageError(f"{site}: [fleet] store: expected a server that the nodes share")
    with closing(Postgres(spec.store)) as database:
        yield spec, SqlOwners(database), Members(database)


def show_fleet(site: Path, as_json: bool) -> None:
    """``evertwin fleet status``."""
    with _fleet(site) as (spec, owners, members):
        found = fleet_told(owners, members, spec.lease)
    lines = []
    for node in found["nodes"]:
        state = "drains" if node["drains"] else "alive" if node["alive"] else "gone"
        lines.append(f"{node['node']:<16} {state:<7} {node['twins']:>3} twins  "
                     f"{node['cost']:>6.2f} s/s  {node['address']}")  # fmt: skip
    for twin in found["twins"]:
        where = twin["node"] if twin["state"] == "owned" else "(nobody)"
        age = "" if twin["age"] is None else f"lease {twin['age']:.1f} s old  "
        lag = "" if twin["lag"] is None else f"lag {twin['lag']:.3f} s  "
        wish = f"wanted at {twin['wanted']}  " if twin["wanted"] else ""
        lines.append(f"  {twin['twin']:<16} {where:<16} {age}{lag}{wish}{twin['reason']}".rstrip())
    show(found, "\n".join(lines) or "no node yet", as_json)


def move_twin(site: Path, twin: str, node: str) -> None:
    """``evertwin fleet move``.

    Raises:
        UsageError: no such twin, or node.
    """
    with _fleet(site) as (_, owners, members):
        names = [one.node for one in members.all()]
        if node and node not in names:
            raise UsageError(f"no node {node!r}; {nearest(node, names)}")
        if not owners.want(twin, node):
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
