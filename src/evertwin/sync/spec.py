"""Settings of the rows that the loop sees, and of how their measurements are judged."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.settings.kinds import (
    Amount,
    Duration,
    Finite,
    Hertz,
    Positive,
    Radians,
    Seconds,
    Spread,
)
from evertwin.settings.notes import Inherit, Key, Quantity, Shorthand
from evertwin.settings.section import Section


@dataclass(frozen=True)
class DeriveSpec(Section):
    """``[[derive]]``: a channel computed from others, per task, in the order written.

    >>> DeriveSpec(name="qdd1", op="derivative", source=("qd1",)).op
    'derivative'
    """

    name: str
    """Name of the new channel."""
    op: Literal[
        "derivative", "filter", "sum", "mean", "difference", "product", "scale", "norm", "max",
        "along", "way", "path", "middle", "slope", "unwrap",
    ]  # fmt: skip
    """What is computed. ``filter``: as ``[filter]`` says. ``middle``: the mean over the interval
    into the row (of the row and the one before). ``slope``: the derivative of a cubic through the
    rows within ``value`` seconds (Savitzky-Golay; one-sided at the ends). ``unwrap``: an angle
    that goes on where it was cut at half a turn or a whole one. From x, y and heading of
    a base: ``along``, the way along its heading; ``way``, the length of its path, each step with
    the sign of its direction; ``path``, that length with one sign, that of the way so far."""
    source: Annotated[tuple[str, ...], Key("from")]
    """Recorded or derived channels it is computed from."""
    unit: str | None = None
    """SI unit of the new channel; absent: what follows from the operation."""
    value: Finite = 1.0
    """Factor of ``scale``; seconds of ``slope``."""


@dataclass(frozen=True)
class SignalSpec(Section):
    """``[signals.NAME]``: a channel of the model.

    >>> SignalSpec(source="v_cmd").low is None
    True
    """

    shorthand = Shorthand("from")

    source: Annotated[str | None, Key("from")] = None
    """Recorded or derived channel, when it is called otherwise."""
    low: Amount | None = None
    """Smallest physically possible value."""
    high: Amount | None = None
    """Largest physically possible value."""
    rate: Spread | None = None
    """Largest possible change per second."""
    hold: bool | None = None
    """Inputs: a command, held from its stamp on (true), or measured at the row and interpolated
    (false). Absent: held for a model with states, where an empty cell among full ones is unknown;
    measured for a static map."""
    judge: bool = True
    """Outputs: false for one that a prediction of a fit starts from, but is not compared with."""
    measured: bool = True
    """Outputs: false for a virtual sensor, which the model computes and nothing records."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise UsageError(f"expected low < high, got {self.low:g} and {self.high:g} in SI")


@dataclass(frozen=True)
class CropSpec(Section):
    """``[clock.crop]``: a fit learns from each task between its first and its last motion.

    >>> CropSpec(channels=("qd1",), above=0.02).inside
    0.0
    """

    channels: tuple[str, ...]
    """Channels that show motion."""
    above: Annotated[float, Quantity(), Ge(0.0)]
    """Smallest absolute value, of any of the channels, that counts as motion."""
    inside: Annotated[Seconds, Ge(0.0)] = 0.0
    """Left out at both ends."""


@dataclass(frozen=True)
class ClockSpec(Section):
    """``[clock]``: the rows.

    >>> ClockSpec().rate is None
    True
    """

    rate: Hertz | None = None
    """Resample each task onto a uniform grid, where a command that changes between two rows is its
    mean over the interval; absent: the union of the stamps."""
    gap: Duration | None = None
    """Longest interval that is simulated over: behind a longer one the state starts anew. Absent:
    four times the longest of the usual intervals between samples (of whichever source; pauses that
    come more often than one interval in 32 are usual), where the model's whole state is measured or
    estimated; else (a model that another program simulates) any."""
    start: Seconds = -math.inf
    """Leave out what lies before, from the start of each task."""
    stop: Seconds = math.inf
    """Leave out what lies after."""
    crop: CropSpec | None = None
    """What a fit learns from of each task: from the first to the last motion; absent: all of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start >= self.stop:
            raise UsageError(f"expected start < stop, got {self.start:g} s and {self.stop:g} s")


@dataclass(frozen=True)
class FilterSpec(Section):
    """``[filter]``: the one filter that goes over measurement and prediction alike.

    >>> FilterSpec(cutoff=5.0).order
    4
    """

    kind: Literal["butterworth", "savgol"] = "butterworth"
    """Both are symmetric and come late by their length: ``butterworth``, as it is forward and
    backward over a recording; ``savgol``, a polynomial over a window."""
    order: Annotated[int, Ge(1), Le(12)] = 4
    """Order of the filter, or of the polynomial of ``savgol``."""
    cutoff: Hertz = 5.0
    """Cut-off frequency; ``savgol``: the window is the odd number of rows nearest to
    rate / cutoff."""
    inputs: tuple[str, ...] = ()
    """Recorded channels that are filtered too, before derivatives are taken."""
    lag: Annotated[Seconds, Ge(0.0)] = 0.0
    """Time constant of a first-order low pass that outputs were measured through; 0: none."""
    lagged: tuple[str, ...] = ()
    """Recorded channels that pass it too, before derivatives are taken: those that inputs are made
    of."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.lagged) != (self.lag > 0.0):
            raise UsageError("expected both lag and lagged, or none of them")


@dataclass(frozen=True)
class MovingSpec(Section):
    """``[moving]``: which rows count as moving, per output.

    >>> MovingSpec(above=0.05).channels
    {}
    """

    above: Annotated[float, Quantity(), Ge(0.0)]
    """Moving where the deciding channel's absolute value exceeds this."""
    channels: Mapping[str, str] = field(default_factory=dict)
    """Output to the input channel that decides for it."""
    tune: bool = False
    """Tune on moving rows only: for friction, which at standstill is not determined."""


@dataclass(frozen=True)
class GroupSpec(Section):
    """``[arbiter.groups.NAME]``: how the measurements of a group of signals are judged, where that
    differs from ``[arbiter]``.

    >>> GroupSpec().vote
    8
    """

    gate: Positive = 4.0
    """Innovation gate in standard deviations."""
    vote: Annotated[int, Ge(2), Le(10_000)] = 8
    """Samples of a group in the vote; longer than the longest credible burst."""
    use: Literal["none", "tolerance", "blend"] = "none"
    """What happens with a trusted measurement."""
    tolerance: Spread = math.inf
    """``tolerance``: adopt it when it differs by more."""
    sigma: Spread = 0.0
    """Standard deviation of the measurement; 0: learned from the residuals."""
    tolerance_angle: Radians = math.inf
    """The same for the angles of a group, such as the heading of a pose."""
    sigma_angle: Annotated[float, Quantity("rad"), Ge(0.0)] = 0.0
    """Standard deviation of a measured angle; 0: learned."""
    growth: Spread = 0.0
    """Growth of the prediction's standard deviation per √s while it predicts; 0: learned."""
    frozen: Annotated[int, Ge(0), Le(1_000_000)] = 5
    """Equal values in a row, while motion is predicted, that make a sensor frozen; 0: never."""
    timeout: Duration | None = None
    """Without a trusted measurement for this long, the state is shown as not valid. Absent: without
    any for five times its longest usual pause, and 1 s at least."""


@dataclass(frozen=True)
class ArbiterSpec(GroupSpec):
    """``[arbiter]``: how measurements are judged.

    >>> ArbiterSpec(vote=8).groups
    {}
    """

    groups: Annotated[Mapping[str, GroupSpec], Inherit()] = field(default_factory=dict)
    """What differs for one group of signals."""
