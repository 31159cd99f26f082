"""How a twin of the service is, in plain values."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from evertwin.sources.live.contract import Health

if TYPE_CHECKING:
    from evertwin.service.twin.runner import Runner

MAKING = (
    "its machine code is being made ready: the first time that takes one to two minutes for each "
    "model, later some seconds"
)
UNJUDGED = {
    "not yet": "too few rows that move have come to judge it",
    "nothing asked": "the twin file asks for no largest deviation ([anomaly] requirement)",
}
"""Why a twin of which nothing bad is known is not called good."""
MANY = 0.05
"""Share of uncertain samples from which on it is told first."""
LONG = 5.0
"""Seconds from which on it is told how long a start took."""


def status_of(runner: Runner) -> dict[str, Any]:
    """Its state, its condition, what came of it so far, its sources and publishers."""
    over = {one.name for one in runner.sources if one.health.state == "ended"}
    ended = runner.sources and len(over) == len(runner.sources)
    state = "ended" if runner.state == "running" and ended and not runner.open else runner.state
    since = runner.lane.busy_since
    busy = 0.0 if since is None else time.monotonic() - since
    about: Mapping[str, Any] = {}
    if runner.work is not None:
        about = runner.work.about
        runner.condition.looked(runner.work.now)
    healths = {one.name: one.health.after(runner.before.get(one.name)) for one in runner.sources}
    headline = " ".join(
        filter(None, (runner.condition.in_past(about.get("headline", "")), _doubted(healths)))
    )
    return {
        "name": runner.name, "state": state, "reason": runner.reason,
        **_how(runner, state, over, about.get("judged")), "rows": runner.row,
        "champion": about.get("champion"), "pinned": about.get("pinned"),
        "versions": len(about.get("versions", ())), "waiting": runner.waiting,
        "headline": headline, "judged": about.get("judged"),
        "dropped": runner.dropped, "busy": round(busy, 3),
        "sources": {name: health.to_dict() for name, health in healths.items()},
        "publishers": [dict(one.health) for one in runner.publishers],
    }  # fmt: skip


def _doubted(healths: Mapping[str, Health]) -> str:
    """Columns of which many samples are called uncertain by the machine itself, in words."""
    said = (
        f"{100 * share:.0f} % of the samples of {column}"
        for health in healths.values() for column, share in health.uncertain.items()
        if share >= MANY
    )  # fmt: skip
    told = ", ".join(said)
    return f"The machine itself calls {told} uncertain." if told else ""


def _how(runner: Runner, state: str, over: set[str], judged: str | None) -> Mapping[str, Any]:
    """Its condition, and why: also where a twin that does not run has none of its own. Good is
    only who was judged, and held."""
    how = runner.condition.told(failed=state == "quarantined", over=over)
    if state == "quarantined":
        how["why"] = runner.reason
    elif state == "starting":
        so_far = f"{time.monotonic() - runner.began:.0f} s so far"
        how["why"] = (
            f"{MAKING}; {so_far}" if runner.warm is not None else f"it is being opened; {so_far}"
        )
        how["condition"] = "check"
    elif runner.stuck > LONG:
        how["condition"] = "check"
        how["why"] = f"{runner.hanging}; {runner.waiting} pieces of samples wait"
    elif how["condition"] == "check":
        known = [
            f"{one.name}: {one.health.reason}" for one in runner.sources
            if one.health.reason and one.health.state not in ("up", "ended")
        ]  # fmt: skip
        how["why"] = "; ".join((how["why"], *known))
    elif how["condition"] == "out_of_specification":
        hints = [f"{one.name}: {one.health.hint}" for one in runner.sources if one.health.hint]
        how["why"] = "; ".join((how["why"], *hints))
    elif how["condition"] == "good" and judged in UNJUDGED:
        how["condition"], how["why"] = "unjudged", UNJUDGED[judged]
    return how
