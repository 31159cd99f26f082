"""The live version's parameters in the stream: predict a beat ahead, then learn.

What wears, warms or settles is followed from beat to beat (``[tuning] method = "recursive"``), and
each joint or channel by itself; what else deviates is still tuned, tried and promoted as ever, from
the values as they are now. A pinned version stays as it is.
"""

from __future__ import annotations

from dataclasses import replace

from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TwinState
from evertwin.loop.versions import Versions
from evertwin.models import LinearModel
from evertwin.models.form import Version
from evertwin.tuning import Following


def following(setup: Setup, versions: Versions, number: int) -> Following | None:
    """The stage of a version; None where it has nothing to follow."""
    version, model, rule = versions[number], versions.model(number), setup.spec.tuning
    if not setup.followed or not isinstance(model, LinearModel):
        return None
    own = versions.values(number)
    # what a ladder has not taken is not there
    names = tuple(n for n in setup.followed if own.get(n) or (n in own and not rule.ladder))
    if not names:
        return None
    return Following(model, names, version.p, rule.memory, rule.spread, rule.caution, setup.gates)


def as_is(versions: Versions, state: TwinState) -> Version:
    """The live version with the values that predict now."""
    version = versions[state.live.version]
    values = version.values if state.stream == () else tuple(state.live.track.p.tolist())
    return replace(version, values=values)
