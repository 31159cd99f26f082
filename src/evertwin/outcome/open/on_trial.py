"""The challenger that is still on trial where a run ends: what it has gained, and what it lacks."""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.ledger.versions import Versions
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TRIAL, TwinState
from evertwin.trial import Check
from evertwin.trial.gate import figures
from evertwin.trial.odds import ODDS, odds

FEW, MANY = 3, 6
"""Numbers that stand for more than so many; parts of a form that are told one by one."""


@dataclass(frozen=True)
class OpenTrial:
    """A trial without a verdict yet.

    >>> lacks = (Check("segments", False, 12.0, 20.0),)
    >>> print(OpenTrial(3, "tuned gain", 400, 12, 0.1, 150.0, lacks, 8, 8.0, ""))
    version 3 (tuned gain) is on trial since row 400: deviation -10.0 % over 12 segments, odds of \
150 to 1; missing: segments 12 of 20; at this pace 8 more segments, 8 s
    """

    version: int
    reason: str
    """What it was made of."""
    since: int
    """Row at which its trial began; −1: in a run before."""
    segments: int
    """Unseen segments that both versions have predicted."""
    gain: float
    """Relative gain in deviation so far."""
    e_value: float
    missing: tuple[Check, ...]
    """Lines of the gate's checklist that are not reached."""
    more: int | None
    """Segments until it goes live, if evidence grows as it has grown; None: cannot be told."""
    seconds: float | None
    """Time of data that these take at the pace of the trial so far [s]."""
    untold: str
    """Why it cannot be told."""

    def __str__(self) -> str:
        """One line."""
        lacks = ", ".join(f"{c.name} {c.value:.3g} of {c.limit:.3g}" for c in self.missing)
        since = "a run before" if self.since < 0 else f"row {self.since}"
        pace = f"how long cannot be told: {self.untold}"
        if self.more is not None:
            pace = f"at this pace {self.more} more segments, {self.seconds:.3g} s"
        return (
            f"version {self.version} ({shorter(self.reason)}) is on trial since {since}: deviation "
            f"{-100 * self.gain:+.1f} % over {self.segments} segments{ODDS}{odds(self.e_value)}; "
            f"missing: {lacks or 'nothing'}; {pace}"
        )


def open_trial(setup: Setup, versions: Versions, state: TwinState) -> OpenTrial | None:
    """The trial that is going on, if one is."""
    if state.agenda.phase != TRIAL:
        return None
    gate, version, found = setup.trial, versions[state.other.version], figures(state.trial)
    more, why = gate.to_come(state.trial)
    if state.agenda.pinned:
        more, why = None, "the live version is pinned"
    seconds = (state.elapsed - state.agenda.tried) * 1e-9
    pace = seconds / max(found["segments"], 1)
    missing = tuple(check for check in gate.checklist(state.trial) if not check.passed)
    since, rate = version.row, setup.spec.clock.rate or setup.measured_rate
    if rate:  # one that was live before was made long ago
        since = max(since, state.row - round(seconds * rate))
    since = -1 if state.agenda.tried <= 0 else since
    return OpenTrial(
        version.number, version.reason, since, found["segments"], found["gain"],
        found["e_value"], missing, more, None if more is None else more * pace, why,
    )  # fmt: skip


def shorter(reason: str) -> str:
    """What a version was made of, without the end of long lists.

    >>> shorter("tuned a, b, c, d, e, f, g; a spring pulls on it")
    'tuned 7 numbers (a, b, c …); a spring pulls on it'
    """
    tuned, *parts = reason.split("; ")
    names = tuned.removeprefix("tuned ").split(", ")
    if tuned.startswith("tuned ") and len(names) > MANY:
        tuned = f"tuned {len(names)} numbers ({', '.join(names[:FEW])} …)"
    rest = [f"and {len(parts) - MANY} more"] if len(parts) > MANY else []
    return "; ".join([tuned, *parts[:MANY], *rest])
