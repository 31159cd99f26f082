"""What ``evertwin doctor site.toml`` says of a fleet: its server, and where each twin can run."""

from __future__ import annotations

from evertwin.errors import EvertwinError
from evertwin.service.site.site_plan import Plan, Site
from evertwin.store.postgres.database import Postgres, told


def shared(site: Site) -> tuple[str, list[str], list[str]]:
    """What is looked at, what it says, and what is wrong there."""
    server = site.spec.fleet.store
    lines = [f"{plan.name}: {_where(plan)}" for plan in site.twins]
    wrong = [
        f"{plan.name}: {one.source} lies on this machine ({one.protocol}), so no other node can "
        f"run it: pin it ([[twin]] node = {site.spec.fleet.name!r})"
        for plan in site.twins
        for one in plan.sources
        if one.lies_here and not plan.entry.node
    ]
    try:
        Postgres(server).close()  # it makes the tables where there are none
    except EvertwinError as error:
        wrong.insert(0, f"down: {error}")
    return f"fleet ({told(server, '')})", lines, wrong


def _where(plan: Plan) -> str:
    return f"pinned to {plan.entry.node}" if plan.entry.node else "any node"
