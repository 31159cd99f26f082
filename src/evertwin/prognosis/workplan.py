"""The work ahead: each piece of the plan simulated with the twin, as wear over that of the past.

A life is first told in the past's clock: as if work went on as before. Here a plan becomes a
`Workload` on that clock, so many times the wear of the past in each phase, and the life goes
through it. Where no work is planned the machine rests; after the plan's end it goes on as before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from evertwin.ahead.basis import Basis
from evertwin.ahead.changes import Case, changed
from evertwin.ahead.spec import LoadSpec, PathSpec, ScenarioSpec, SpeedSpec
from evertwin.ahead.whatif import Today
from evertwin.config.prognosis import PrognosisSpec, WorkSpec
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.laws import Indicator, Workload
from evertwin.prognosis.parameter_history import UNITS
from evertwin.prognosis.wear import wear
from evertwin.types import StateVector


class Piece(NamedTuple):
    """A piece of the work ahead, ready to be simulated.

    >>> Piece._fields[:2]
    ('begin', 'until')
    """

    begin: float
    until: float
    cycles: float
    """Per unit of the clock."""
    case: Case
    x: StateVector
    """State before the cycle."""


class Plan(NamedTuple):
    """All that is planned, and what it is held against.

    >>> Plan._fields
    ('before', 'pieces', 'usual')
    """

    before: Piece
    """The newest recorded task, once."""
    pieces: tuple[Piece, ...]
    usual: Piece
    """What goes on after the plan's end, in times of how often it was done so far."""


def plan_of(
    basis: Basis, today: Today, works: Sequence[WorkSpec], scenario: ScenarioSpec | None = None,
    *, continuous: bool = False,
) -> Plan:  # fmt: skip
    """The cases of a plan.

    Args:
        basis: the twin's live version.
        today: the newest recorded task.
        works: the work ahead; empty: as it was.
        scenario: what changes each of them, and what goes on after them.
        continuous: the machine works all the time, so a shorter task is done more often.

    Raises:
        UsageError: a load, a speed or a value that this machine cannot have.
        DataError: a path that cannot be read.
    """
    before = Piece(0.0, float("inf"), 1.0, today.case, today.x)
    pieces = tuple(_piece(basis, today, work, scenario) for work in works)
    end = max((piece.until for piece in pieces), default=0.0)
    usual = before if scenario is None else _under(basis, before, today, scenario)
    if continuous:
        times = [float(piece.case.future.dt.sum()) for piece in (before, usual)]
        usual = usual._replace(cycles=times[0] / times[1])
    return Plan(before, pieces, usual._replace(begin=end))


def _piece(basis: Basis, today: Today, work: WorkSpec, scenario: ScenarioSpec | None) -> Piece:
    told = ScenarioSpec(
        work.name, folder=basis.setup.spec.folder, parameters=work.parameters,
        speed=None if work.speed == 1.0 else SpeedSpec(work.speed),
        load=None if work.load == 0.0 else LoadSpec(work.load),
        path=None if work.path is None else PathSpec(file=work.path),
    )  # fmt: skip
    until = float("inf") if work.until is None else work.until
    recorded = Piece(work.begin, until, work.cycles, today.case, today.x)
    try:
        piece = _under(basis, recorded, today, told)
        return piece if scenario is None else _under(basis, piece, today, scenario)
    except (UsageError, DataError) as error:
        raise type(error)(f"work {work.name!r}: {error}") from error


def _under(basis: Basis, piece: Piece, today: Today, scenario: ScenarioSpec) -> Piece:
    x = piece.x if scenario.path is None else today.newest
    return piece._replace(case=changed(basis, piece.case, scenario), x=x)


def past_cycles(rule: PrognosisSpec, indicator: Indicator) -> float:
    """Cycles of the newest task per unit of the clock so far.

    Raises:
        ConfigError: nothing tells how often the machine worked.
    """
    if rule.past is not None:
        return rule.past
    if indicator.usage is not None:
        return Workload.as_before(indicator).mean_rate(0.0)
    if rule.clock in UNITS:
        raise ConfigError(
            f"[prognosis] past: expected how many cycles like the newest recorded task were done "
            f"per {rule.clock} so far: the work ahead is held against them"
        )
    return 1.0


def workload(formula: Formula, plan: Plan, past: float) -> Workload:
    """Wear ahead, the past's wear per unit of the clock being 1.

    Args:
        formula: wear per second.
        plan: the cases.
        past: cycles of the newest task per unit of the clock so far.

    Raises:
        UsageError: the past wears nothing by this formula, or a cycle's wear is no number.
    """
    once = wear(formula, plan.before.case, plan.before.x)
    if not once * past > 0.0:
        raise UsageError(
            f"the newest recorded task wears nothing by {formula.text!r}, so that no other work "
            "can be held against it: record one that moves, or give the [[indicator]] its wear"
        )
    usual = plan.usual._replace(cycles=plan.usual.cycles * past)
    pieces = [p for p in (*plan.pieces, usual) if p.begin < p.until]
    rates = [p.cycles * wear(formula, p.case, p.x) / (once * past) for p in pieces]
    ends = {0.0, *(p.begin for p in pieces), *(p.until for p in pieces)} - {float("inf")}
    begins = sorted(ends)
    together = [
        sum(rate for p, rate in zip(pieces, rates, strict=True) if p.begin <= moment < p.until)
        for moment in begins
    ]
    return Workload.phases(begins, together)
