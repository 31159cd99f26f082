"""Who tells what a twin says: its publishers, opened."""

from __future__ import annotations

from evertwin.publishers.contract import About, Ask, Publisher
from evertwin.publishers.registry import open_publisher
from evertwin.service.at_work import AtWork
from evertwin.service.plan import Plan


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
