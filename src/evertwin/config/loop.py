"""The settings of the loop: arbiter, prediction, anomaly, tuning, correction, trial.

The defaults serve every case that evertwin ships; a twin file says only what differs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from evertwin.config.data import Seconds, Spread
from evertwin.errors import UsageError
from evertwin.settings.fields import Inherit, Limits, Quantity, Section
from evertwin.settings.quantity import written
from evertwin.signals.units import compatible

__all__ = [
    "AnomalySpec",
    "ArbiterSpec",
    "CorrectionSpec",
    "CutSpec",
    "PredictionSpec",
    "SarsaSpec",
    "TrialSpec",
    "TuningSpec",
]


@dataclass(frozen=True)
class ArbiterSpec(Section):
    """``[arbiter]`` and ``[arbiter.groups.NAME]``: how measurements are judged.

    >>> ArbiterSpec().vote
    8
    """

    gate: Annotated[float, Limits(above=0.0)] = 4.0
    """Innovation gate in standard deviations."""
    vote: Annotated[int, Limits(at_least=2)] = 8
    """Samples of a group in the vote; longer than the longest credible burst."""
    use: Literal["none", "tolerance", "blend"] = "none"
    """What happens with a trusted measurement."""
    tolerance: Spread = math.inf
    """``tolerance``: adopt it when it differs by more."""
    sigma: Spread = 0.0
    """Standard deviation of the measurement; 0: learned from the residuals."""
    tolerance_angle: Annotated[float, Quantity("rad"), Limits(above=0.0)] = math.inf
    """The same for the angles of a group, such as the heading of a pose."""
    sigma_angle: Annotated[float, Quantity("rad"), Limits(at_least=0.0)] = 0.0
    """Standard deviation of a measured angle; 0: learned."""
    growth: Spread = 0.0
    """Growth of the prediction's standard deviation per √s while it predicts; 0: learned."""
    frozen: Annotated[int, Limits(at_least=0)] = 5
    """Equal values in a row, while motion is predicted, that make a sensor frozen; 0: never."""
    timeout: Annotated[Seconds, Limits(above=0.0)] = math.inf
    """Without a trusted measurement for this long, the state is shown as not valid."""
    groups: Annotated[Mapping[str, ArbiterSpec], Inherit()] = field(default_factory=dict)
    """What differs for one group of signals."""


@dataclass(frozen=True)
class PredictionSpec(Section):
    """``[prediction]``: over which horizon models are compared and tuned.

    >>> PredictionSpec().horizon
    inf
    """

    horizon: Annotated[Seconds, Limits(above=0.0)] = math.inf
    """Predictions restart from the measured state after this time; inf: once a task."""
    scale: Mapping[str, Annotated[Spread, Limits(above=0.0)]] = field(default_factory=dict)
    """Output to the size that counts as 1 in a loss; absent: the rms of its first residuals."""


@dataclass(frozen=True)
class AnomalySpec(Section):
    """``[anomaly]``: when the twin is suspected to differ from its machine.

    >>> AnomalySpec(requirement=0.05).relative
    True
    """

    requirement: Annotated[Spread, Limits(above=0.0)] = math.inf
    """Largest deviation: relative to the rms of the measurement, or in the output's unit."""
    relative: bool = True
    """Is ``requirement`` a share? By default true for a bare number, false with a unit."""
    snr: Annotated[float, Limits(at_least=0.0)] = 0.0
    """Signal-to-noise threshold; 0: not used."""
    false_alarms_per_month: Annotated[float, Limits(above=0.0)] = 1.0
    """Over all outputs together; sets the detectors' limits."""
    calibration: Annotated[Seconds, Limits(at_least=0.0)] = 0.0
    """Calm data that sets the run-length limits; 0: as soon as it suffices; inf: the whole first
    task, and further ones only if it does not suffice."""
    phases: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Input to the borders (SI, rising) that divide its range: each regime has its own limits."""
    outputs: tuple[str, ...] = ()
    """Outputs that are watched; empty: all."""
    window: Annotated[int, Limits(at_least=1)] = 600
    """Rows over which the requirement is judged (or the task, where tasks end earlier)."""

    @classmethod
    def prepare(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """A requirement with a unit is absolute: "2 cm" is never 2 % of anything."""
        value = table.get("requirement")
        unit = written(value)[1] if isinstance(value, str) else ""
        if not unit or compatible(unit, "1"):
            return table
        if table.get("relative") is True:
            raise UsageError(f"requirement {value!r} has a unit, so it is not relative")
        return {"relative": False, **table}


@dataclass(frozen=True)
class CutSpec(Section):
    """``[tuning.cut]``: a fit predicts over windows of its recordings, not over whole tasks.

    >>> CutSpec(length=4.0).step is None
    True
    """

    length: Annotated[Seconds, Limits(above=0.0)]
    """Length of a window; each starts anew from the measured state."""
    step: Annotated[Seconds, Limits(above=0.0)] | None = None
    """From one window's start to the next; absent: ``length``, so that they do not overlap."""


@dataclass(frozen=True)
class TuningSpec(Section):
    """``[tuning]``: which parameters, how, when.

    >>> TuningSpec().method
    'auto'
    """

    editable: tuple[str, ...] | None = None
    """Parameters that may be tuned; absent: what the model proposes. ``*`` matches any text."""
    method: Literal["auto", "recursive", "iteration"] = "auto"
    """``auto``: solved at once; ``recursive``: in the stream; ``iteration``: relaxed rounds."""
    every: Annotated[Seconds, Limits(above=0.0)] = math.inf
    """Also tune on a schedule, not only when suspected."""
    window: Annotated[int, Limits(at_least=2)] = 6000
    """Newest rows that a fit looks at."""
    loss: Literal["linear", "soft_l1", "huber", "cauchy", "arctan"] = "linear"
    """How large residuals are weighed."""
    starts: Annotated[int, Limits(at_least=1)] = 1
    """Starts of a nonlinear search: the given values, then points spread over the bounds."""
    workers: Annotated[int, Limits(at_least=1)] = 1
    """``fit``: processes that differences are simulated in, for models in slow Python."""
    weights: Mapping[str, Annotated[float, Limits(at_least=0.0)]] = field(default_factory=dict)
    """Parameter to how often it is tuned, relative to the others."""
    ladder: tuple[str, ...] = ()
    """Variants of the model, simplest first, climbed while held-out error falls."""
    cut: CutSpec | None = None
    """Windows that ``fit`` cuts its recordings into; absent: whole tasks."""
    causes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Cause to its parameters; competing refits name the cause of a deviation."""
    relaxation: Annotated[float, Limits(above=0.0, at_most=1.0)] = 0.4
    """Step of the iteration mode."""
    follow: tuple[str, ...] = ()
    """``recursive``: tuned parameters that are followed in the stream; empty: all."""
    learn: Annotated[Seconds, Limits(above=0.0)] = 1.0
    """``recursive``: predict for so long, then learn."""
    memory: Annotated[Seconds, Limits(above=0.0)] = 20.0
    """``recursive``: time constant of forgetting towards the prior."""
    spread: Annotated[float, Limits(above=0.0)] = 0.1
    """``recursive``: standard deviation of the prior, relative to the fitted value."""
    caution: Annotated[float, Limits(above=0.0)] = 3.0
    """``recursive``: noise that is assumed, in units of the fit's residual."""


@dataclass(frozen=True)
class SarsaSpec(Section):
    """``[correction.sarsa]``: what the agent that learns a table is rewarded for.

    The defaults are table 1 of Müller, Jazdi, Weyrich.

    >>> SarsaSpec().penalty
    -5.0
    """

    near: Annotated[Spread, Limits(above=0.0)] = 0.01
    """Deviation below which an action is rewarded."""
    reward: float = 1.0
    """Reward of such an action."""
    penalty: float = -5.0
    """Reward of any other."""
    end: Annotated[Spread, Limits(above=0.0)] = 0.02
    """Deviation beyond which an episode ends."""
    end_angle: Annotated[float, Quantity("rad"), Limits(above=0.0)] = 0.01
    """Rotational deviation beyond which an episode ends."""
    alpha: Annotated[float, Limits(above=0.0, at_most=1.0)] | None = None
    """Learning rate; absent: 1 / number of visits."""
    gamma: Annotated[float, Limits(at_least=0.0, below=1.0)] = 0.0
    """Discount."""
    epsilon: Annotated[float, Limits(at_least=0.0, at_most=1.0)] = 0.1
    """Share of actions tried at random (``replay`` and ``literal``)."""
    first: float = 0.0
    """Value of an action before it was tried."""
    accumulate: bool = False
    """Does the deviation add up over an episode?"""
    passes: Annotated[int, Limits(at_least=1)] = 50
    """Times that ``replay`` goes through the log."""


@dataclass(frozen=True)
class CorrectionSpec(Section):
    """``[correction]``: how the model's form may be corrected.

    >>> CorrectionSpec().terms
    ()
    """

    channels: tuple[str, ...] = ()
    """Inputs (or states, for ``state``) that may be corrected."""
    terms: tuple[Literal["lag", "table", "law", "coupling", "surface", "state"], ...] = ()
    """Kinds of term that may be tried; empty: the form stays."""
    learner: Literal["full", "replay", "literal"] = "full"
    """How a table is learned: with full information, by replay of the log, sample by sample."""
    quantum: Spread = 0.0
    """Step of a table's levels; 0: proposed from the data."""
    refine: bool = True
    """Replace a table by a continuous law where that predicts better."""
    watch: tuple[str, ...] = ()
    """Inputs for which the table was learned; when they change a new training sequence starts."""
    window: Annotated[int, Limits(at_least=2)] = 6000
    """Newest rows that a correction is learned on."""
    sarsa: SarsaSpec = SarsaSpec()
    """Settings of the agent that learns a table."""
    in_fit: bool = False
    """``fit`` searches for terms as well, judged on held-out parts of its recordings."""
    horizon: Annotated[Seconds, Limits(above=0.0)] | None = None
    """Length of the predictions that ``fit`` judges terms on; absent: that of ``[prediction]``."""


@dataclass(frozen=True)
class TrialSpec(Section):
    """``[trial]``: the gate to the live model. One set of settings serves all machines.

    >>> TrialSpec().alpha
    0.01
    """

    alpha: Annotated[float, Limits(above=0.0, below=0.5)] = 0.01
    """Chance of promoting a challenger that is no better."""
    margin: Annotated[float, Limits(at_least=0.0, below=1.0)] = 0.05
    """Smallest relative gain on unseen data."""
    segments: Annotated[int, Limits(at_least=2)] = 20
    """Fewest segments."""
    limit: Annotated[int, Limits(at_least=2)] = 2000
    """Segments after which a trial ends without promotion."""
    probation: Annotated[int, Limits(at_least=10)] = 150
    """Segments after a promotion during which the old champion runs along."""
    holdoff: Annotated[int, Limits(at_least=0)] = 100
    """Rows after a rejection or roll-back before the next candidate."""
