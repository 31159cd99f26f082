"""What tells how worn an arm's joints are, as `init` proposes it: their friction as a whole.

Coulomb and viscous friction of one fit trade against each other; their sum at the speed that the
joint usually has does not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from evertwin.models import Model
from evertwin.starter.looks.seen import Seen
from evertwin.starter.numbers.speeds import fastest
from evertwin.starter.proposal import Proposal

USUAL = 0.5
"""Part of the speed below which a joint nearly always goes."""


def at_usual_speed(model: Model, proposal: Proposal, seen: Sequence[Seen]) -> tuple[str, ...]:
    """Of each joint the speed [rad/s] that its friction is told at; nothing where one has no
    friction, or nobody says how fast it goes."""
    joints = range(1, len(model.outputs) + 1)
    if not all({f"Fc{j}", f"Fv{j}"} <= {*model.parameters.names} for j in joints):
        return ()
    found = [USUAL * fastest(proposal, seen, f"qd{j}", f"q{j}") for j in joints]
    known = all(math.isfinite(speed) and speed > 0.0 for speed in found)
    return tuple(f"{speed:.1g}" for speed in found) if known else ()
