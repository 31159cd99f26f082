"""Who tells what a twin says: its publishers, opened."""

from __future__ import annotations

from evertwin.publishers.contract import About, Ask, Publisher
from evertwin.publishers.registry import open_publisher
from evertwin.service.site.site_plan import Plan
from evertwin.service.twin.live_twin import AtWork


def tellers(plan: Plan, work: AtWork, ask: Ask) -> list[Publisher]:
    """The publishers of a twin, which begin to connect.

    Raises:
        EvertwinError: one cannot be opened.
    """
    outputs = [(c.name, c.unit) for c in work.twin.model.outputs]
    about = About(plan.name, outputs, work.scene)
    opened = [open_publisher(settings, about, ask) for settings in plan.publishers]
    for one in opened:
        one.open()
    return opened
