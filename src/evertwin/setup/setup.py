"""What a twin is made of, once its file and its model are known: stages and limits, all frozen."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evertwin.anomaly import External, Kinematics, Recurrence, Regimes, Still, TaskSteps
from evertwin.config.spec import TwinSpec
from evertwin.errors import ConfigError, UsageError
from evertwin.fold import Beat
from evertwin.fold.span import Span
from evertwin.models import LinearModel, Model
from evertwin.rows.channels import is_measured, measured, motions, unit_told
from evertwin.rows.plausibility import arbiter_of
from evertwin.rows.ring import Ring
from evertwin.rows.smoothing import low_pass
from evertwin.setup.at_horizon import AtHorizon
from evertwin.setup.detectors import Detect
from evertwin.setup.residual_filter import ResidualFilter
from evertwin.setup.scores import Watch
from evertwin.signals.sizes import sizes
from evertwin.signals.spoken import MANY, number, share, suited
from evertwin.sync import Track
from evertwin.sync.horizon.horizon import nanoseconds
from evertwin.trial import PROBATION, Trial
from evertwin.types import Bools, Outputs, PerOutput

BACK = 10
"""Windows of a table that are kept: a machine is seldom at all levels within one."""
FEW = 5
"""Fewest samples that a deviation is judged on at a beat."""
NOT_LINEAR = (
    "[tuning] method = 'recursive': expected outputs that are linear in every editable parameter: "
    "use method = 'auto', or name fewer in editable"
)
SEGMENT = 1.0
"""Length of a segment of a static map, and of a free run, when no horizon is given [s]."""


def matching(
    names: tuple[str, ...], patterns: tuple[str, ...], what: str = "parameter", key: str = ""
) -> tuple[str, ...]:
    """The ``names`` that match one of the ``patterns``, in their own order.

    Args:
        names: what there is.
        patterns: ``*`` matches any text.
        what: they are called.
        key: of ``[tuning]``, where the patterns stand.

    >>> matching(("Fc1", "Fc2", "Bm1"), ("Fc*",), "parameter")
    ('Fc1', 'Fc2')

    Raises:
        UsageError: a pattern matches nothing.
    """
    for pattern in patterns:
        if not fnmatch.filter(names, pattern):
            where = f"[tuning] {key}: " if key else ""
            raise UsageError(f"{where}no {what} matches {pattern!r}: there are {', '.join(names)}")
    return tuple(n for n in names if any(fnmatch.fnmatchcase(n, p) for p in patterns))


STILL, LEAST_STILL = 2.0, 20
"""Seconds without a change, and rows at least, after which an input is asked about."""


@dataclass(frozen=True)
class Setup:
    """A twin's frozen parts.

    Raises:
        UsageError: a pattern of `[tuning]` matches no parameter.

    >>> Setup.__name__
    'Setup'
    """

    spec: TwinSpec
    model: Model
    """The base model, with the twin file's parameters."""
    measured_rate: float | None = None
    """Rows per second of the data, for times where ``[clock]`` gives no rate."""

    def __post_init__(self) -> None:
        _ = self.editable, self.causes, self.weights, self.once  # a pattern without a parameter

    def at(self, rate: float | None) -> Setup:
        """The same for data of so many rows per second, unless ``[clock]`` says how many."""
        return self if self.spec.clock.rate is not None else replace(self, measured_rate=rate)

    @property
    def times(self) -> bool:
        """Is any window, beat or hold-off a time?"""
        spec = self.spec
        spans = (spec.beat, spec.anomaly.window, spec.tuning.window, spec.correction.window)
        return any(span.rows is None for span in (*spans, spec.trial.holdoff))

    def track(self, model: Model) -> Track:
        """The stage that follows the machine with a version."""
        return Track(model, arbiter_of(self.spec, model), self.gates)

    @cached_property
    def adopts(self) -> Bools:
        """Which outputs a state takes over from their measurement, (ny,)."""
        return self.track(self.model).adopts

    @cached_property
    def static(self) -> bool:
        """Has the model no state?"""
        return len(self.model.states) == 0

    @cached_property
    def horizon(self) -> float:
        """Length of a prediction [s]; of a block of losses for a static map."""
        given = self.spec.prediction.horizon
        return SEGMENT if self.static and math.isinf(given) else given

    @cached_property
    def beat(self) -> Beat:
        """Where decisions may happen."""
        return Beat(self.rows(self.spec.beat))

    @cached_property
    def ring(self) -> Ring:
        """The newest rows, as many as slow work may look at until its answer, `latency` rows on."""
        size = max(self.window("fit"), self.window("correct")) + self.latency + 1
        return Ring(size, len(self.model.inputs), len(self.model.outputs))

    @cached_property
    def at_horizon(self) -> AtHorizon:
        """Which residuals count: those of predictions that have reached their horizon."""
        wanted = not self.static and math.isfinite(self.horizon) and self.spec.filter is None
        return AtHorizon(wanted, len(self.model.outputs))

    @cached_property
    def residual_filter(self) -> ResidualFilter:
        """The filter over released rows."""
        low = None if self.spec.filter is None else low_pass(self.spec)
        hold = self.external.window - 1 if self.external.longest > 0.0 else 0
        return ResidualFilter(low, len(self.model.outputs), hold)

    @cached_property
    def smooth_window(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """The same filter over the columns of a window in memory; None without one."""
        low = self.residual_filter.low_pass
        return None if low is None else low.smooth

    def moving(self, u: np.ndarray) -> np.ndarray:
        """Which rows count as moving, per output, C (n, ny); all where nothing is said of one."""
        rule = self.spec.moving
        if rule is None:
            return np.ones((len(u), len(self.model.outputs)), dtype=np.bool_)
        columns, unsaid = self.judged_by
        return np.ascontiguousarray((np.abs(u[:, columns]) > rule.above) | unsaid)

    @cached_property
    def judged_by(self) -> tuple[np.ndarray, np.ndarray]:
        """Column of the inputs that tells whether an output moves; and the outputs without one."""
        channels = self.spec.moving.channels if self.spec.moving else {}
        said = [channels.get(name) for name in self.model.outputs.names]
        columns = [0 if name is None else self.model.inputs.index(name) for name in said]
        return np.array(columns), np.array([name is None for name in said])

    @property
    def gates(self) -> tuple[tuple[int, int, float], ...]:
        """(output, input, threshold): an output moves where the input is larger."""
        rule = self.spec.moving
        if rule is None:
            return ()
        columns, unsaid = self.judged_by
        return tuple((k, int(columns[k]), rule.above) for k in np.flatnonzero(~unsaid).tolist())

    @cached_property
    def regimes(self) -> tuple[np.ndarray, Regimes] | None:
        """Columns of the inputs that define the phase, and their borders."""
        phases = self.spec.anomaly.phases
        if not phases:
            return None
        columns = np.array([self.model.inputs.index(name) for name in phases])
        return columns, Regimes(tuple(tuple(borders) for borders in phases.values()))

    @cached_property
    def steps(self) -> TaskSteps:
        """Steps of a task that repeats; one where nothing is said."""
        rule = self.spec.anomaly.steps
        return TaskSteps() if rule is None else TaskSteps(rule.duration, rule.parts)

    def phase(self, u: np.ndarray, t: np.ndarray, began: int) -> np.ndarray:
        """Phase of each row of a task that began at a stamp, (n,); 0 where none are set."""
        step = self.steps.of(t, began)
        if self.regimes is None:
            return step
        columns, regimes = self.regimes
        regime = regimes.of(u[:, columns])
        return np.where(regime < 0, -1, regime * self.steps.parts + step)

    @property
    def decides(self) -> bool:
        """Is anything tuned or corrected: is there a requirement, a schedule, or a stream?"""
        rule = self.spec.tuning
        scheduled = math.isfinite(self.requirement) or math.isfinite(rule.every)
        return scheduled or rule.method == "recursive"

    @cached_property
    def followed(self) -> tuple[str, ...]:
        """Names of the parameters that follow the machine in the stream.

        Raises:
            ConfigError: the outputs are not linear in one of them.
        """
        rule = self.spec.tuning
        if rule.method != "recursive":
            return ()
        names = matching(self.editable, rule.follow, "editable parameter") or self.editable
        names = tuple(name for name in names if name not in self.once)
        linear = isinstance(self.model, LinearModel) and not self.model.outputs.angles.any()
        found = self.model.columns if linear else np.zeros(0)  # type: ignore[attr-defined]
        if not set(self.model.parameters.indices(names).tolist()) <= set(found.ravel().tolist()):
            raise ConfigError(NOT_LINEAR)
        return names

    @cached_property
    def requirement(self) -> float:
        """Largest deviation; infinite: none."""
        return self.spec.anomaly.requirement

    @cached_property
    def relative(self) -> bool:
        """Is it relative to the measurement?"""
        return self.spec.anomaly.relative

    @cached_property
    def watched(self) -> np.ndarray:
        """Outputs that are held to it, (ny,)."""
        names = self.spec.anomaly.outputs or tuple(
            name for name in self.model.outputs.names if is_measured(self.spec, name)
        )
        for name in names:
            self.model.outputs.index(name)
        return np.array([name in names for name in self.model.outputs.names])

    def watch(self, beats: np.ndarray, held: bool) -> Watch:
        """How the champion is judged before the rows ``beats``; if it ``held`` before, sooner."""
        return Watch(beats, self.enough, FEW, self.requirement, self.relative, self.watched, held)

    @cached_property
    def enough(self) -> int:
        """Rows that a deviation is judged on."""
        return self.rows(self.spec.anomaly.window)

    least: int = 30
    """Fewest rows that a deviation is judged on when a task ends."""

    @cached_property
    def schedule(self) -> int:
        """Time between scheduled fits [ns]."""
        return nanoseconds(self.spec.tuning.every)

    @cached_property
    def latency(self) -> int:
        """Rows that slow work may take before a file run waits for it."""
        return self.beat.every

    def window(self, kind: str) -> int:
        """Newest rows that a kind of request looks at."""
        if kind in ("fit", "retell"):  # what was found over a window is explained over all of it
            return max(self.rows(self.spec.tuning.window), self.enough)
        rule = self.spec.correction
        return self.rows(rule.window) * (BACK if rule.translated else 1)

    @property
    def holdoff(self) -> int:
        """Rows after a rejection before the next candidate."""
        return self.rows(self.spec.trial.holdoff)

    def rows(self, span: Span) -> int:
        """The rows of a span, at the rate of the clock or of the data."""
        return self.spec.rows(span, self.measured_rate)

    @cached_property
    def recorded(self) -> tuple[str, ...]:
        """The unit of each output in the twin file; empty where it has none."""
        return tuple(unit_told(self.spec, channel) for channel in self.model.outputs)

    def sizes(self, y: Outputs) -> PerOutput:
        """What the requirement is a share of, (ny,); 1 where it has a unit."""
        return sizes(y, self.model.outputs.temperatures) if self.relative else np.ones(y.shape[1])

    def shown(self, output: int, value: float) -> str:
        """A deviation in words."""
        if self.relative:
            return f"{100 * value:.1f} %" if value < MANY else share(value)
        unit, factor = suited(abs(value), self.model.outputs.units[output], self.recorded[output])
        return number(value * factor, "" if unit == "1" else unit, 3)

    @cached_property
    def editable(self) -> tuple[str, ...]:
        """Names of the base model's parameters that may be tuned."""
        own, given = self.model.parameters, self.spec.tuning.editable
        found = own.editable if given is None else matching(own.names, given, key="editable")
        return tuple(name for name in found if not own[name].fixed)

    @cached_property
    def weights(self) -> dict[str, float]:
        """Parameter → how often it is tuned."""
        names, weights = self.model.parameters.names, self.spec.tuning.weights
        return {
            name: float(weight)
            for pattern, weight in weights.items()
            for name in matching(names, (pattern,), key="weights")
        }

    @cached_property
    def causes(self) -> dict[str, tuple[str, ...]]:
        """Cause → its parameters."""
        names = self.model.parameters.names
        found = {
            cause: matching(names, patterns, key=f"causes.{cause}")
            for cause, patterns in self.spec.tuning.causes.items()
        }
        for name, state in self.spec.tuning.states.items():
            if state.number not in found[name]:
                raise UsageError(
                    f"[tuning] states.{name}: number {state.number!r} is none of the parameters of "
                    f"causes.{name}: {', '.join(found[name])}"
                )
        return found

    @cached_property
    def once(self) -> frozenset[str]:
        """Names of the parameters that stay once the twin has held its requirement."""
        return frozenset(matching(self.model.parameters.names, self.spec.tuning.once, key="once"))

    @cached_property
    def trial(self) -> Trial:
        """The gate to the live model."""
        rule, horizon = self.spec.trial, self.horizon if math.isfinite(self.horizon) else 1.0
        return Trial(
            alpha=rule.alpha, margin=rule.margin, segments=rule.segments, limit=rule.limit,
            horizon=horizon, duration=rule.lasts(horizon),
        )  # fmt: skip

    @cached_property
    def probation(self) -> Trial:
        """What a fresh champion has to stand."""
        return replace(PROBATION, limit=self.spec.trial.probation)

    @cached_property
    def detect(self) -> Detect:
        """The detectors over released rows."""
        phases = self.steps.parts * (1 if self.regimes is None else self.regimes[1].count)
        rate = self.at_horizon.wanted and (self.spec.clock.rate or self.measured_rate)
        rows = max(round(self.horizon * rate), 1) if rate else 1
        found = Detect.of(self.spec.anomaly, self.model.outputs, self.watched, phases, rows)
        return replace(found, steps=self.steps)

    @property
    def known_rate(self) -> float | None:
        """Rows per second, where the file or the stamps tell."""
        return self.spec.clock.rate or (self.measured_rate if self.times else None)

    @cached_property
    def external(self) -> External:
        """The observer of contacts: of a static map, where the rate of its rows is known and the
        speed of what moves: friction that changed comes and goes with its direction."""
        rate = self.known_rate
        told = self.static and rate and not self.judged_by[1].all()
        longest = self.spec.anomaly.external if told else 0.0
        return External(self.model.outputs.names, rate or 1.0, longest)

    @cached_property
    def recurrence(self) -> Recurrence:
        """The observer of contacts that come again."""
        return Recurrence(len(self.model.inputs))

    @cached_property
    def still(self) -> Still:
        """The observer of the measured channels by which is known what moves."""
        by, unsaid = self.judged_by
        rate = self.known_rate if self.static else None
        deciding = set(by[~unsaid].tolist()) if rate else set()
        found = measured(self.spec, self.model.inputs).values()
        which = tuple(tuple(columns) for columns, _ in found if deciding & set(columns))
        return Still(which, max(LEAST_STILL, round(STILL * (rate or 1.0))))

    @cached_property
    def kinematics(self) -> Kinematics:
        """The observer of measured positions and speeds that a static map takes as inputs."""
        rate, inputs = self.known_rate if self.static else None, self.model.inputs
        pairs = tuple(motions(self.spec, inputs)) if rate else ()
        names = tuple((inputs.names[q], inputs.names[v]) for q, v in pairs)
        columns = tuple((q, v, int(inputs.angles[q])) for q, v in pairs)
        return Kinematics(names, columns, rate or 1.0, inputs.units)
