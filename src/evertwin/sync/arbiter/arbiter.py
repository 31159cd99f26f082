"""The arbiter: which of the two is right, measurement or simulation?

An obvious measurement error: the simulation is trusted. Any other inconsistency: the measurement
overrules the simulation, even if that violates physics (a position jumps). This is the rule of
Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital Twin", section 3. One
gate cannot do that, so each sample of a signal group passes four steps:

1. *Syntax*: NaN, infinity, refused by its source → error.
2. *Hard plausibility*: range, rate, frozen while the model predicts motion (one value, two in
   turn, or less scatter than the sensor's own noise; spikes in between), sentinel code, suspected
   factor (10ⁿ, 180/π, 25.4, a foot, −1; rpm of rad/s) → obvious error: predict on, less certain.
   One value at an end of all values is a full scale or a stop, until it misses the way back.
3. *Innovation gate*: innovation² ≤ gate²·S + path². S is the arbiter's own, from the statistics of
   the innovation (per phase where one is set), growing while it predicts; path is twice
   what the model predicted to move since the last trusted sample, or usually does (the tolerance,
   if that is more). Inside → nothing, a tolerance update (adopt the measurement when it differs by
   more than a tolerance), or a blend.
4. Outside → *contested*: marked at once, predict on, and vote over the last k samples of the group.
   They agree with each other → the newest overrules the simulation. Back inside → they were
   measurement errors. Where a factor explains them as well, their scatter decides: it keeps the
   sensor's noise after a jump and is multiplied by a change of units (`factor_loop`). What is
   believed can be taken back later (`beside_loop`).

Tolerance updates and overrulings are different events. The innovation is the change since the last
trusted sample, beside the prediction: a slow drift of the model is no error of the sensor.

What one sensor cannot tell: its own slow drift from the machine's, a sensor frozen with as much
noise as it had from a machine that stands, a burst longer than the vote from a machine that was
moved there and back, and a sign that turns at zero from a machine that goes the other way.
The measurement is believed in these cases.

>>> Rule(use="tolerance", tolerance=0.02).vote
8
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Event
from evertwin.models import Model
from evertwin.signals import Layout
from evertwin.signals.mistaken import numbers
from evertwin.sync import places as at
from evertwin.types import Bools, Vector

SENTINELS = (
    -32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0, 4294967295.0, 2143289344.0,
    -999.0, -9999.0, 9999.0, 99999.0, 1e30, 3.4028234663852886e38,
)  # fmt: skip
"""Values that devices send for "no value"; believed to be that only outside the gate."""
_USE = {"none": at.NONE, "tolerance": at.UPDATE, "blend": at.MIX}


@dataclass(frozen=True)
class Rule:
    """How the samples of a group are judged.

    >>> Rule().gate, Rule().use
    (4.0, 'none')
    """

    gate: float = 4.0
    """Innovation gate in standard deviations."""
    vote: int = 8
    """Samples of the group in the vote; longer than the longest credible burst."""
    use: Literal["none", "tolerance", "blend"] = "none"
    """What happens with a trusted sample."""
    tolerance: float = math.inf
    """``tolerance``: a linear channel is adopted when it differs by more [its unit]."""
    tolerance_angle: float = math.inf
    """The same for an angle [rad]."""
    sigma: float = 0.0
    """Standard deviation of a linear channel at first [its unit]; 0: learned from 16 samples."""
    sigma_angle: float = 0.0
    """The same for an angle [rad]."""
    growth: float = 0.0
    """Growth of the prediction's standard deviation [unit/√s]; 0: from ``blend``, per sample."""
    frozen: int = 5
    """Equal values in a row, while motion is predicted, that make a sensor frozen; 0: never."""
    timeout: float | None = None
    """Without a trusted sample for this long [s] the group is shown as not valid; None: without any
    sample for far longer than usual."""
    blend: float = 0.2
    """Weight of a sample in a steady blend; more after a pause."""
    share: float = 2.0
    """Share of the predicted motion that may be wrong without a doubt about the sensor; 2: the
    machine may do the opposite."""

    def __post_init__(self) -> None:
        for name in ("gate", "timeout", "tolerance", "tolerance_angle"):
            if getattr(self, name) is not None and not getattr(self, name) > 0:
                raise UsageError(f"{name}: expected a number above 0, got {getattr(self, name)}")
        for name in ("sigma", "sigma_angle", "growth", "share"):
            if not 0 <= getattr(self, name) < math.inf:
                raise UsageError(f"{name}: expected a number ≥ 0, got {getattr(self, name)}")
        if self.vote < 2 or self.frozen < 0 or self.frozen == 1 or not 0 < self.blend < 1:
            raise UsageError(
                "expected vote ≥ 2, frozen 0 or ≥ 2 and blend between 0 and 1, got "
                f"vote = {self.vote}, frozen = {self.frozen}, blend = {self.blend}"
            )

    def numbers(self) -> tuple[float, ...]:
        """The settings in the order of the compiled loop."""
        return (
            self.gate, float(self.vote), float(_USE[self.use]), self.blend, self.share,
            self.growth, float(self.frozen), self.timeout or 0.0,
        )  # fmt: skip


@dataclass(frozen=True)
class Phases:
    """Regimes with statistics of their own: intervals of one input.

    >>> Phases("v", (-0.01, 0.01)).edges
    (-0.01, 0.01)
    """

    channel: str
    """Input that decides."""
    edges: tuple[float, ...]
    """Borders of the intervals, increasing."""

    def __post_init__(self) -> None:
        steps = np.diff(np.array(self.edges))
        if not self.edges or not np.isfinite(self.edges).all() or not (steps > 0).all():
            raise UsageError(f"phases: expected increasing numbers, got {self.edges}")


@dataclass(frozen=True)
class Arbiter:
    """Rules per group of outputs.

    >>> Arbiter(Rule(gate=5.0)).rule_of("pose").gate
    5.0
    """

    rule: Rule = Rule()
    """For every group that has none of its own."""
    groups: Mapping[str, Rule] = field(default_factory=dict)
    phases: Phases | None = None
    sentinels: tuple[float, ...] = SENTINELS

    def rule_of(self, group: str) -> Rule:
        """The rule that holds for a group."""
        return self.groups.get(group, self.rule)

    def limits(self, outputs: Layout, adopts: Bools) -> np.ndarray:
        """Settings per output for the compiled loop, (ny, 6)."""
        rows = []
        for channel, adopted in zip(outputs, adopts.tolist(), strict=True):
            rule, angle = self.rule_of(channel.group), channel.kind == "angle"
            tolerance = rule.tolerance_angle if angle else rule.tolerance
            rows.append((channel.low, channel.high, channel.rate, tolerance, angle, adopted))
        return np.array(rows, dtype=np.float64).reshape(-1, 6)

    def rules(self, outputs: Layout) -> np.ndarray:
        """Settings per group for the compiled loop, (groups, 8).

        Raises:
            UsageError: a rule is given for a group that does not exist.
        """
        for name in self.groups:
            if name not in outputs.groups:
                there = ", ".join(outputs.groups)
                raise UsageError(f"arbiter: no group {name!r} among the outputs: there are {there}")
        return np.array([self.rule_of(name).numbers() for name in outputs.groups]).reshape(-1, 8)

    def sigmas(self, outputs: Layout) -> Vector:
        """Standard deviations known beforehand, (ny,); 0 where to be learned."""
        rules = [self.rule_of(channel.group) for channel in outputs]
        pairs = zip(rules, outputs.angles, strict=True)
        return np.array([rule.sigma_angle if angle else rule.sigma for rule, angle in pairs])


def members(outputs: Layout) -> np.ndarray:
    """Outputs of each group, (groups, most) int64, filled up with −1."""
    table = np.full((len(outputs.groups), max(len(outputs), 1)), -1)
    for g in range(len(table)):
        which = np.flatnonzero(outputs.group_of == g)
        table[g, : len(which)] = which
    return table


_CAUSES = {
    at.Cause.SYNTAX: "unreadable, or refused by its source",
    at.Cause.RANGE: "outside the physically possible range",
    at.Cause.RATE: "faster than physically possible",
    at.Cause.FROZEN: "frozen while the model predicts motion",
    at.Cause.SENTINEL: "a code for 'no value'",
    at.Cause.FACTOR: "off by a factor",
    at.Cause.AWAY: "believed, but back where the model without it expects it",
    at.Cause.VOTE: "far from what was predicted, and its samples did not agree with each other",
}


def describe(model: Model, found: np.ndarray, detail: np.ndarray) -> Event:
    """A finding of the compiled loop as a record."""
    row, time, kind, g, cause, first, final, number = found.tolist()
    if kind >= at.Finding.INPUT:
        return _input_event(model.inputs, found, detail)
    outputs = model.outputs
    ny = len(outputs)
    group = outputs.groups[g]
    which = [j for j in range(ny) if outputs.group_of[j] == g]
    evidence: dict[str, object] = {"onset": first, "end": final, "samples": number}
    delta = {outputs.names[j]: float(detail[1 + j]) for j in which}
    sigma = {outputs.names[j]: math.sqrt(detail[1 + ny + j]) for j in which}
    if kind == at.Finding.ERROR or kind == at.Finding.RESTORED:
        if cause == at.Cause.END:
            over = kind == at.Finding.RESTORED
            evidence |= {"cause": "end", "delta": delta, "over": over}
            return _event(row, time, "at_limit", group, _at_limit(over, first, final), evidence)
        reason = _CAUSES[at.Cause(cause)]
        odd = _farthest(delta, sigma) if len(which) > 1 else ()
        evidence["cause"] = at.Cause(cause).name.lower()
        if cause == at.Cause.FACTOR:
            evidence["factor"] = float(detail[0])
            reason = f"off by a factor of {_factor(detail[0], [outputs.units[j] for j in which])}"
        evidence["delta"] = delta
        reason = f"{reason}: {', '.join(odd)}" if odd else reason
        if kind == at.Finding.RESTORED:
            return _event(row, time, "measurement_restored", group, f"no longer {reason}", evidence)
        return _event(row, time, "measurement_error", group, reason, evidence)
    if kind == at.Finding.OVERRULED:
        units = dict(zip(outputs.names, outputs.units, strict=True))
        jump = ", ".join(
            f"{name} by {d:+.4g} {units[name]}".removesuffix(" 1") for name, d in delta.items()
        )
        reason = f"{number} samples agree with each other: {jump}"
        return _event(
            row, time, "overruled", group, reason, {**evidence, "delta": delta, "sigma": sigma}
        )
    if kind == at.Finding.STALE:
        reason = "no trusted sample within the time-out"
        if number:  # milliseconds
            reason = f"no value of it came for {number * 1e-3:.3g} s, far longer than usual"
        return _event(row, time, "not_valid", group, reason, {})
    if kind == at.Finding.FRESH:
        return _event(row, time, "valid", group, "trusted samples are back", {"since": first})
    reason = "too many samples outside the gate: its variance was doubled"
    return _event(row, time, "gate_widened", group, reason, {"sigma": sigma})


FAR = 0.1
"""Share of the largest distance, in standard deviations, from which on a channel is named."""


def _farthest(delta: Mapping[str, float], sigma: Mapping[str, float]) -> tuple[str, ...]:
    """Channels of a group that are far from what was predicted, beside which others are near."""
    away = {name: abs(d) / sigma[name] for name, d in delta.items() if 0.0 < sigma[name] < math.inf}
    most = max(away.values(), default=0.0)
    return tuple(name for name, size in away.items() if most > 0.0 and size >= FAR * most)


def _input_event(inputs: Layout, found: np.ndarray, detail: np.ndarray) -> Event:
    row, time, kind, k, beyond, first, final, number = found.tolist()
    value, low, high, factor = detail[:4].tolist()
    unit = inputs.units[k]
    evidence = {"onset": first, "end": final, "samples": number, "range": [low, high]}
    if kind == at.Finding.SOUND:
        reason = f"{value:.4g} {unit} is believed again"
        return _event(row, time, "measurement_restored", inputs.names[k], reason, evidence)
    if beyond == at.Outside.POSSIBLE:
        reason = f"{value:.4g} {unit} is outside the physically possible range"
        return _event(row, time, "measurement_error", inputs.names[k], reason, evidence)
    if factor and beyond != at.Outside.UNNAMED:
        evidence["factor"] = factor
        reason = (
            f"{value:.4g} {unit} is off by a factor of {_factor(factor, [unit])} from what it was, "
            "and the outputs do not follow it: taken divided by that"
        )
        return _event(row, time, "measurement_error", inputs.names[k], reason, evidence)
    how = f"divided by {factor:.5g}" if factor else "as it was before"
    reason = (
        f"{value:.4g} {unit} lies far outside of what it was ({low:.4g} to {high:.4g} {unit}), and "
        f"the outputs do not follow it: taken {how}"
    )
    return _event(row, time, "measurement_error", inputs.names[k], reason, evidence)


def _at_limit(over: bool, first: int, final: int) -> str:
    """Of values that stay where all values of an output end."""
    if over:
        return f"no longer where all its values end, as from row {first} to {final}"
    return (
        f"stays where all its values end, since row {first}, while the model predicts motion: the "
        "end of its sensor's range, a stop of the machine, or a sensor that froze there; which of "
        "them cannot be told, and no number is tuned to these rows"
    )


def _event(
    row: int, time: int, kind: str, group: str, reason: str, evidence: Mapping[str, object]
) -> Event:
    return Event(row, time, kind, group, reason, evidence)  # type: ignore[arg-type]


def _factor(value: float, units: Sequence[str]) -> str:
    """The number, and which units it divides that the quantities of ``units`` are recorded in."""
    known = {180 / math.pi: "180/π", math.pi / 180: "π/180", 1 / 25.4: "1/25.4", 0.3048: "1/3.281"}
    told = (said for unit in units for number, said in numbers(unit)
            if " for " in said and abs(value / number - 1.0) < 1e-3)  # fmt: skip
    said = next(told, "")
    return known.get(float(value), f"{value:.5g}") + (f" ({said})" if said else "")
