"""The arbiter's settings, from the twin file to the room that uses them."""

from __future__ import annotations

import math

from evertwin.config.spec import TwinSpec
from evertwin.models import Model
from evertwin.signals import Layout
from evertwin.sync import Arbiter, Phases, Rule
from evertwin.sync.spec import GroupSpec


def arbiter_of(spec: TwinSpec, model: Model) -> Arbiter:
    """The arbiter over a model's outputs, in SI."""
    groups = {name: _rule(rule, model.outputs, name) for name, rule in spec.arbiter.groups.items()}
    return Arbiter(_rule(spec.arbiter, model.outputs, ""), groups, _phases(spec))


def _phases(spec: TwinSpec) -> Phases | None:
    """Regimes of one input have innovation statistics of their own; more inputs share theirs."""
    if len(spec.anomaly.phases) != 1:
        return None
    ((channel, borders),) = spec.anomaly.phases.items()
    return Phases(channel, tuple(borders))


def _rule(spec: GroupSpec, outputs: Layout, group: str) -> Rule:
    """A tolerance is in the unit of the channels it is about: angles have their own."""
    inside = [c for c in outputs if not group or c.group == group]
    angles_only = bool(inside) and all(c.kind == "angle" for c in inside)
    linear = (math.inf, 0.0) if angles_only else (spec.tolerance, spec.sigma)
    angle = (
        (spec.tolerance, spec.sigma) if angles_only else (spec.tolerance_angle, spec.sigma_angle)
    )
    return Rule(
        gate=spec.gate, vote=spec.vote, use=spec.use, tolerance=linear[0],
        tolerance_angle=angle[0], sigma=linear[1], sigma_angle=angle[1], growth=spec.growth,
        frozen=spec.frozen, timeout=spec.timeout,
    )  # fmt: skip
