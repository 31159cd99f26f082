"""Settings of tuning: which parameters, how, when, and over which horizon."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from evertwin.errors import UsageError
from evertwin.fold.span import Span
from evertwin.settings.kinds import Duration, Positive, Size
from evertwin.settings.notes import Rows
from evertwin.settings.section import Section


@dataclass(frozen=True)
class PredictionSpec(Section):
    """``[prediction]``: over which horizon models are compared and tuned.

    >>> PredictionSpec().horizon
    inf
    """

    horizon: Duration = math.inf
    """Predictions restart from the measured state after this time; inf: once a task."""
    scale: Mapping[str, Size] = field(default_factory=dict)
    """Output to the size that counts as 1 in a loss; absent: the rms of its first residuals."""


@dataclass(frozen=True)
class CutSpec(Section):
    """``[tuning.cut]``: a fit predicts over windows of its recordings, not over whole tasks.

    >>> CutSpec(length=4.0).step is None
    True
    """

    length: Duration
    """Length of a window; each starts anew from the measured state."""
    step: Duration | None = None
    """From one window's start to the next; absent: ``length``, so that they do not overlap."""


@dataclass(frozen=True)
class StateSpec(Section):
    """``[tuning.states.NAME]``: a cause that comes and goes within seconds, such as a load.

    >>> StateSpec(number="payload.m", says="carries").over
    'over'
    """

    number: str
    """Parameter, among those of the cause, that says how much it is."""
    says: str = "is there with"
    """What is said before the number: "carries" for "carries 3 kg"."""
    over: str = "over"
    """What is said when it has gone."""


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
    every: Duration = math.inf
    """Also tune on a schedule, not only when suspected."""
    window: Annotated[Span, Rows(least=2)] = Span(6000)
    """Newest rows, or time, that a fit looks at."""
    loss: Literal["linear", "soft_l1", "huber", "cauchy", "arctan"] = "linear"
    """How large residuals are weighed."""
    starts: Annotated[int, Ge(1), Le(10_000)] = 1
    """Starts of a nonlinear search: the given values, then points spread over the bounds."""
    weights: Mapping[str, Annotated[float, Ge(0.0)]] = field(default_factory=dict)
    """Parameter to how often a scheduled tuning takes it, relative to the others; a deviation takes
    all."""
    ladder: tuple[str, ...] = ()
    """Variants of the model, simplest first, climbed while held-out error falls."""
    cut: CutSpec | None = None
    """Windows that ``fit`` cuts its recordings into; absent: whole tasks."""
    causes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Cause to its parameters; competing refits name the cause of a deviation."""
    states: Mapping[str, StateSpec] = field(default_factory=dict)
    """Causes that come and go: told by their number, tuned alone, and adopted after seconds."""
    once: tuple[str, ...] = ()
    """Parameters that stay once the twin has held its requirement; ``*`` matches any text."""
    relaxation: Annotated[float, Gt(0.0), Le(1.0)] = 0.4
    """Step of the iteration mode."""
    follow: tuple[str, ...] = ()
    """``recursive``: tuned parameters that are followed in the stream; empty: all but ``once``."""
    learn: Duration = 1.0
    """``recursive``: ``fit`` predicts a test for so long, then learns; a run from beat to beat."""
    memory: Duration = 20.0
    """``recursive``: time constant of forgetting towards the prior, in a run that of motion."""
    spread: Positive = 0.1
    """``recursive``: standard deviation of the prior, relative to the fitted value."""
    caution: Positive = 3.0
    """``recursive``: noise that is assumed, in units of the residual."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.states:
            if name not in self.causes:
                there = ", ".join(self.causes) or "none"
                raise UsageError(
                    f"states.{name}: expected the name of a cause, whose parameters are tuned for "
                    f"it; causes has {there}"
                )
