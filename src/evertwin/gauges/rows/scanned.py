"""A pose that scans tell: what [perception] may have wrong of the lidar, and what to write there.

A lidar that is turned turns the heading, beams that run the other way round mirror the pose, and
ranges in another unit make all ways longer or shorter.

>>> from evertwin.config.spec import ModelSpec, PerceptionSpec, TwinSpec
>>> from evertwin.sources.spec import ArraySpec
>>> spec = TwinSpec("base", ModelSpec("differential"), array=(ArraySpec("scan", (60,)),),
...                 perception=PerceptionSpec("scan", start=0.0, step=math.radians(2.0)))
>>> turned_by(spec, math.radians(-30.0))
"turned = '30 deg' in [perception], if that is confirmed"
>>> other_way(spec)
"the beams of scan look to run the other way round ([perception] start = '0 deg', step = '-2 deg')"
"""

from __future__ import annotations

import math

from evertwin.config.spec import PerceptionSpec, TwinSpec
from evertwin.models import Model
from evertwin.rows.channels import recorded_as


def rule_of(spec: TwinSpec, names: tuple[str, ...]) -> PerceptionSpec | None:
    """By which scans tell these outputs; None: they do not tell them all."""
    rule, recorded = spec.perception, {name for one in spec.source for name in one.channels}
    scanned = set() if rule is None else {*rule.pose} - recorded
    return rule if {recorded_as(spec, name) for name in names} <= scanned else None


def pose_of(spec: TwinSpec, model: Model) -> tuple[str, str, str] | None:
    """Outputs that are x, y and heading by scans; None: not all of them are there."""
    rule, names = spec.perception, {recorded_as(spec, n): n for n in model.outputs.names}
    if rule is None or not {*rule.pose} <= {*names} or rule_of(spec, (*names.values(),)) is None:
        return None
    x, y, heading = (names[one] for one in rule.pose)
    return x, y, heading


def turned_by(spec: TwinSpec, shift: float) -> str:
    """What to write where a heading is right with ``shift`` [rad] added to it."""
    rule = spec.perception
    turned = math.remainder((0.0 if rule is None else rule.turned) - shift, 2.0 * math.pi)
    return f"turned = '{math.degrees(turned):.4g} deg' in [perception], if that is confirmed"


def other_way(spec: TwinSpec) -> str:
    """What beams that run the other way round look like, and what to write."""
    rule = spec.perception
    assert rule is not None
    known = [(name, getattr(rule, name)) for name in ("start", "step")]
    told = [f"{n} = '{math.degrees(-v) + 0.0:.6g} deg'" for n, v in known if v is not None]
    what = f"the beams of {rule.scan} look to run the other way round"
    return f"{what} ([perception] {', '.join(told) or 'start and step, with their signs turned'})"


def or_unit(spec: TwinSpec, model: Model, names: tuple[str, ...]) -> str:
    """What else makes speeds, or ways, so many times what they are; nothing: something else."""
    pose, rule = pose_of(spec, model), spec.perception
    speeds = {one.name for one in model.inputs if one.unit == "m/s"}
    if rule is None or pose is None or not ({*names} <= speeds or {*names} == {*pose[:2]}):
        return ""
    return f" (or the ranges of {rule.scan} are not in '{rule.unit}', which [perception] unit says)"
