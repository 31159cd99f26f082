"""The gate: champion and challenger predict the same unseen segments; one of them goes on.

Both predict every segment of one horizon from the measured state, before either learns from it.
The challenger is promoted only if every line of the checklist holds at the same segment: enough
segments and time, a pooled gain that is worth a switch, a sequential test that may be read after
every segment (`evertwin.trial.betting`), and no safety measure worse. It is rejected when the
evidence says that it is worse, or when the limit is reached. One set of settings serves losses of
any unit and size.

Probation is the same bets on fresh segments, with the champion that was replaced as the other: if
they say that it is better, the new one is rolled back; if they say that the new one is better, or
nothing for the length of the probation, it stays.

>>> noise = np.random.default_rng(0).normal(size=200) ** 2
>>> trial = Trial()
>>> state, verdict = trial.step(trial.init(), np.stack([4.0 * noise, noise], axis=1))
>>> verdict, trial.verdict(state)[1]["gain"]
('promote', 0.5)
>>> [check.name for check in trial.checklist(state)]
['segments', 'time', 'gain', 'evidence', 'safety']
>>> PROBATION.step(PROBATION.init(), np.stack([4.0 * noise, noise], axis=1))[1]
'roll_back'
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.trial.betting import GRID, LENGTHS, Bets, evidence, open_bets, passed_on
from evertwin.trial.gate_loop import OPEN, OTHER, STAYS, run, unsafe
from evertwin.trial.odds import ODDS, odds
from evertwin.types import Float64, Int64, Vector

Verdict = Literal["promote", "reject", "roll_back", "keep"]
OWN = 5
"""Segments that the newest of several challengers has to predict itself."""
_LARGEST = 600.0
"""Logarithm above which an e-value is shown as this."""


class GateState(NamedTuple):
    """State of a trial or of a probation.

    >>> Trial().init().tally.tolist()
    [0, 0]
    """

    ahead: Bets
    """Bets that the other version is better than the live one."""
    back: Bets
    """Bets that it is worse."""
    sums: Float64[np.ndarray, " four"]
    """Σ deviation (rms per segment) of live and other, Σ loss of live and other."""
    harm: Vector
    """Σ of the safety measures: (live, other) each."""
    tally: Int64[np.ndarray, " two"]
    """Verdict, segments."""


def new_state(measures: int) -> GateState:
    """The state before the first segment."""
    return GateState(
        open_bets(), open_bets(), np.zeros(4), np.zeros(2 * measures), np.zeros(2, dtype=np.int64)
    )


@dataclass(frozen=True)
class Check:
    """One line of the gate's checklist.

    >>> Check("gain", True, 0.3, 0.05).passed
    True
    """

    name: str
    passed: bool
    value: float
    limit: float


@dataclass(frozen=True)
class Trial:
    """Settings of the gate.

    >>> Trial(alpha=0.01).margin
    0.05
    """

    alpha: float = 0.01
    """Chance that a challenger without gain is promoted, however often one looks."""
    margin: float = 0.05
    """Smallest pooled gain in deviation (rms per segment) that is worth a switch."""
    proven: float = 0.02
    """Gain that the sequential test has to prove."""
    segments: int = 20
    """Segments at least."""
    duration: float = 30.0
    """Time that they must cover at least [s]."""
    horizon: float = 1.0
    """Length of a segment [s]."""
    limit: int = 2000
    """Segments after which an undecided challenger is rejected."""
    alpha_reject: float = 0.01
    """Chance that an equal challenger is rejected early as worse."""
    measures: int = 0
    """Safety measures per segment: counts where less is better, such as limits exceeded."""
    words: tuple[Verdict, Verdict] = ("promote", "reject")
    """What it is called where the other version is better, and where the live one stays."""

    def __post_init__(self) -> None:
        for name in ("alpha", "alpha_reject"):
            if not 0 < getattr(self, name) < 1:
                raise UsageError(f"{name}: expected within (0, 1), got {getattr(self, name)}")
        if not 0 <= self.proven <= self.margin < 1:
            raise UsageError(
                f"trial: expected 0 <= proven <= margin < 1, got proven {self.proven} and margin "
                f"{self.margin}"
            )
        if not self.horizon > 0:
            raise UsageError(f"horizon: expected a duration above 0 s, got {self.horizon}")

    @cached_property
    def least(self) -> int:
        """Segments at least, so that the least time is covered too."""
        return max(self.segments, math.ceil(self.duration / self.horizon - 1e-9))

    @cached_property
    def rule(self) -> Vector:
        """The settings as the loop reads them."""
        return np.array(
            [self.proven, -math.log(self.alpha), -math.log(self.alpha_reject), self.margin,
             self.least, max(self.limit, self.least)]
        )  # fmt: skip

    def init(self) -> GateState:
        """The state before the first segment."""
        return new_state(self.measures)

    def step(
        self, state: GateState, losses: Float64[np.ndarray, "m columns"]
    ) -> tuple[GateState, Verdict | None]:
        """The state after more segments, and the verdict once there is one.

        Consumes ``state``. What comes after the deciding segment changes nothing.

        Args:
            state: from `init` or an earlier step.
            losses: per segment: mean of (residual / scale)² of champion and challenger, then per
                safety measure the counts of both, (m, 2 + 2·measures).

        Raises:
            UsageError: another number of columns.
        """
        columns = 2 + len(state.harm)
        if losses.ndim != 2 or losses.shape[1] != columns:
            raise UsageError(
                f"trial: expected {columns} columns per segment (loss of live and other version, "
                f"then both counts per safety measure), got shape {losses.shape}"
            )
        if len(losses):
            run(losses, self.rule, LENGTHS, GRID, state)
        return state, self._told(state)

    def _told(self, state: GateState) -> Verdict | None:
        return {OPEN: None, OTHER: self.words[0], STAYS: self.words[1]}[int(state.tally[0])]

    def passed_on(self, state: GateState) -> GateState:
        """The state for a better challenger in the place of one that has been winning.

        What is bet on is then whichever challenger was the newest, and that was known before each
        segment: the evidence stays valid. The new one has to predict some segments of its own.
        Consumes ``state``.

        >>> gate = Trial()
        >>> won, _ = gate.step(gate.init(), np.tile([4.0, 1.0], (28, 1)))
        >>> gate.passed_on(won).tally.tolist(), gate.passed_on(gate.init()).tally.tolist()
        ([0, 25], [0, 0])
        """
        found = figures(state)
        if found["gain"] < self.margin:
            return self.init()
        kept = min(found["segments"], self.least - OWN)
        state.sums[:] *= kept / found["segments"]
        state.tally[:] = OPEN, kept
        return state._replace(ahead=passed_on(state.ahead), back=passed_on(state.back))

    def verdict(self, state: GateState) -> tuple[Verdict | None, dict[str, Any]]:
        """The verdict (None: undecided) and the evidence as plain scalars, with a sentence."""
        found = figures(state)
        if self.words == PROBATION.words:
            return self._told(state), found | {"sentence": _stood(found)}
        said = (
            f"{_change(found)} over {found['segments']} unseen segments"
            f"{ODDS}{odds(found['e_value'])} that it is no chance"
        )
        missed = [check.name for check in self.checklist(state) if not check.passed]
        if missed:
            said += f"; not reached: {', '.join(missed)}"
        return self._told(state), found | {"sentence": said, "missed": tuple(missed)}

    def checklist(self, state: GateState) -> tuple[Check, ...]:
        """Every line of the gate with its figure and limit, at any time."""
        found = figures(state)
        segments, gain = found["segments"], found["gain"]
        seconds, value = segments * self.horizon, found["e_value"]
        worst = float(np.max(state.harm[1::2] - state.harm[::2], initial=0.0))
        return (
            Check("segments", segments >= self.segments, float(segments), float(self.segments)),
            Check("time", seconds >= self.duration * (1.0 - 1e-9), seconds, self.duration),
            Check("gain", gain >= self.margin, gain, self.margin),
            Check("evidence", value >= 1 / self.alpha, value, 1 / self.alpha),
            Check("safety", not unsafe(state.harm), worst, 0.0),
        )

    def to_come(self, state: GateState) -> tuple[int | None, str]:
        """Segments until it is promoted, at the pace of those so far; None, and why: not told.

        >>> Trial().to_come(Trial().init())
        (None, 'no segment has ended yet')
        """
        found, bar = figures(state), -math.log(self.alpha)
        n, log = found["segments"], math.log(max(found["e_value"], 1e-300))
        if not n:
            return None, "no segment has ended yet"
        if found["gain"] < self.margin:
            return None, f"the gain is below {100 * self.margin:.3g} %"
        if unsafe(state.harm):
            return None, "a safety measure is worse"
        if log <= 0:
            return None, "the evidence does not grow"
        more = max(self.least - n, math.ceil(n * (bar - log) / log), 1)
        limit = int(self.rule[-1])
        if n + more > limit:
            return None, f"at this pace the limit of {limit} segments comes first"
        return more, ""


PROBATION = Trial(
    alpha=0.05, alpha_reject=0.05, margin=0.0, proven=0.0, segments=10, duration=0.0, limit=150,
    words=("roll_back", "keep"),
)  # fmt: skip
"""What a promoted version has to stand: its losses are (live version, replaced version)."""


def figures(state: GateState) -> dict[str, Any]:
    """The figures behind a decision, as plain scalars.

    >>> figures(Trial().init())["e_value"]
    1.0
    """
    ahead, back = evidence(state.ahead), evidence(state.back)
    n = max(int(state.tally[1]), 1)
    live, other, live2, other2 = (float(v) / n for v in state.sums)
    return {
        "segments": int(state.tally[1]),
        "deviation_live": live,
        "deviation_other": other,
        "rms_live": math.sqrt(live2),
        "rms_other": math.sqrt(other2),
        "gain": 1 - other / live if live > 0 else 0.0,
        "e_value": math.exp(min(ahead, _LARGEST)),
        "e_value_against": math.exp(min(back, _LARGEST)),
    }


def _change(found: Mapping[str, Any]) -> str:
    gain = 100 * found["gain"]
    return f"{abs(gain):.1f} % {'less' if gain >= 0 else 'more'} deviation"


def _stood(found: Mapping[str, Any]) -> str:
    return (
        f"the replaced version's deviation is {-100 * found['gain']:+.1f} % of the live one's "
        f"over {found['segments']} segments{ODDS}{odds(found['e_value'])} for the replaced "
        f"and {odds(found['e_value_against'])} for the live version"
    )
