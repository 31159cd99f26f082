"""The work ahead: each piece of the plan simulated with the twin, as wear over that of the past.

A life is first told in the past's clock: as if work went on as before. Here a plan becomes a
`Workload` on that clock, so many times the wear of the past in each phase, and the life goes
through it. Where no work is planned the machine rests; after the plan's end it goes on as before.

What one cycle of work wears: a formula over its simulated course, summed over its time.

An indicator may say the formula (``wear``). Else it follows from the machine: at a joint, or where
there is one effort and one speed, ``|τ|^e·|q̇|``: for e = 1 the way weighted by the load (sliding
parts, Archard), for e = 3 the revolutions by the cube of the load (ball bearings, ISO 281). Without
an effort it is the way that the simulated lengths or angles travel, else the way that is commanded,
else the time in use. Only ratios of wear mean something.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from evertwin.ahead.basis import Basis
from evertwin.ahead.changes import Case, changed
from evertwin.ahead.spec import LoadSpec, PathSpec, ScenarioSpec, SpeedSpec
from evertwin.ahead.whatif import Today
from evertwin.config.prognosis import IndicatorSpec, PrognosisSpec, WorkSpec
from evertwin.errors import ConfigError, DataError, UsageError, naming
from evertwin.models import Model
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.laws import Indicator, Workload
from evertwin.prognosis.laws.series.calendar import UNITS
from evertwin.signals import Channel, Layout, wrap
from evertwin.signals.channels import position
from evertwin.signals.units import compatible
from evertwin.types import Inputs, Intervals, Outputs, ParameterVector, StateVector, Vector

RATE = ".rate"
"""Behind the name of a channel: its change per second, of angles too."""
STATE = "state."
"""Before the name of a state that an input or output has as well."""
EFFORTS, SPEEDS = ("N", "Nm", "A"), ("m/s", "rad/s")
PLACES = ("m", "rad")


def wears(rule: IndicatorSpec, model: Model) -> Formula:
    """Wear per second of what an indicator tells of, over the model's names.

    Raises:
        ConfigError: the indicator's formula is not understood, or names what the model has not.
    """
    if rule.wear is None:
        return Formula.parse(_joints(rule, model) or _way(model) or "1")
    with naming(f"indicator {rule.name}: wear", UsageError, ConfigError):
        formula = Formula.parse(rule.wear)
        for name in formula.names:
            position(_known(model), name, "input, output, state or parameter")
    return formula


def wear(formula: Formula, case: Case, x: StateVector) -> float:
    """Wear of one cycle.

    Args:
        formula: wear per second, of `wears`.
        case: the cycle.
        x: state before it; the model's own start where it does not fit the model.

    Raises:
        UsageError: it is no number, or below zero.
    """
    each = np.full(len(case.future.dt), formula(_columns(formula, case, x)))
    if not np.isfinite(each).all():
        row = int(np.argmin(np.isfinite(each))) + 1
        raise UsageError(f"wear: {formula.text!r} is no number in row {row} of the cycle")
    found = float(np.sum(each * case.future.dt))
    if found < 0.0:
        raise UsageError(f"wear: {formula.text!r} is {found:.3g} over a cycle, expected 0 or more")
    return found


def _known(model: Model) -> tuple[str, ...]:
    told = (*model.outputs.names, *model.inputs.names)
    marked = (STATE + name for name in model.states.names)
    channels = dict.fromkeys((*told, *model.states.names, *marked))
    return (*channels, *model.parameters.names, *(name + RATE for name in channels))


def _columns(formula: Formula, case: Case, x: StateVector) -> dict[str, float | Vector]:
    """What the formula's names stand for over the rows of the cycle.

    A name that several have is the output's, then the input's, the state's, the parameter's.
    """
    model, (u, dt) = case.model, case.future
    start = x if len(x) == len(model.states) else model.initial(case.p)
    _, y = model.simulate(start, u, dt, case.p)
    wanted = {name.removesuffix(RATE) for name in formula.names}
    sides = [(model.inputs, model.inputs.names, u), (model.outputs, model.outputs.names, y)]
    told = {*model.inputs.names, *model.outputs.names}
    if wanted & {n for name in model.states.names for n in (STATE + name, name)} - told:
        rows = _states(model, start, (u, dt), case.p)
        plain = (model.states, model.states.names, rows)
        marked = (model.states, tuple(STATE + name for name in model.states.names), rows)
        sides = [plain, marked, *sides]
    values: dict[str, float | Vector] = dict(
        zip(model.parameters.names, case.p.tolist(), strict=True)
    )
    for layout, names, columns in sides:
        for k in (k for k, name in enumerate(names) if name in wanted):
            values[names[k]] = columns[:, k]
            values[names[k] + RATE] = _rate(columns[:, [k]], dt, layout.angles[[k]])
    return values


def _states(
    model: Model, x: StateVector, rows: tuple[Inputs, Intervals], p: ParameterVector
) -> Outputs:
    """The state at the end of each row, (n, nx)."""
    u, dt = rows
    found = np.empty((len(dt), len(x)))
    for i in range(len(dt)):
        x, _ = model.simulate(x, u[i : i + 1], dt[i : i + 1], p)
        found[i] = x
    return found


def _rate(column: Outputs, dt: Intervals, angle: np.ndarray) -> Vector:
    """Change per second; in the first row, before which nothing is known, that of the second."""
    step = wrap(np.diff(column, axis=0), angle)[:, 0]
    found = np.divide(step, dt[1:], out=np.zeros(len(step)), where=dt[1:] > 0.0)
    return np.concatenate([found[:1] if len(found) else np.zeros(1), found])


def _joints(rule: IndicatorSpec, model: Model) -> str:
    """Wear of the joints that an indicator names by number; of the only one, where there is one."""
    channels = {c.name: c for c in (*model.inputs, *model.outputs)}
    pairs = []
    for name in _told(rule):
        for number in reversed(re.findall(r"\d+", name)):
            effort = next((n for n in (f"tau{number}", f"i{number}") if n in channels), None)
            if effort is not None and f"qd{number}" in channels:
                pairs.append((effort, f"qd{number}"))
                break
    if not pairs:
        efforts, speeds = (_of(channels.values(), units) for units in (EFFORTS, SPEEDS))
        pairs = [(efforts[0], speeds[0])] if len(efforts) == len(speeds) == 1 else []
    power = "" if rule.exponent == 1.0 else f" ** {rule.exponent:g}"
    return " + ".join(f"abs({load}){power} * abs({speed})" for load, speed in dict.fromkeys(pairs))


def _told(rule: IndicatorSpec) -> Sequence[str]:
    """Names of what an indicator is made of."""
    if rule.formula is not None:
        return Formula.parse(rule.formula).names
    column = None if rule.file is None else rule.column or rule.name
    return [name for name in (rule.parameter, rule.output, column) if name is not None]


def _way(model: Model) -> str:
    """The way that lengths, else angles, travel in the simulation, else as they are told to."""
    every = (*model.inputs, *model.outputs)
    if not (_of(every, (*EFFORTS, *SPEEDS)) or _of(model.inputs, (*PLACES, "V"))):
        return ""  # a heater, a pump that fills a tank to a level in m: time tells
    lengths = _of(model.outputs, ("m",))
    if lengths:
        squares = " + ".join(f"{name}{RATE} ** 2" for name in lengths)
        return f"sqrt({squares})" if len(lengths) > 1 else f"abs({lengths[0]}{RATE})"
    turns = _of(model.outputs, ("rad",))
    if turns:
        return " + ".join(f"abs({name}{RATE})" for name in turns)
    sides: tuple[Layout, Layout] = (model.outputs, model.inputs)
    ways = (_of(side, (unit,)) for side in sides for unit in SPEEDS)
    return next((" + ".join(f"abs({name})" for name in names) for names in ways if names), "")


def _of(channels: Iterable[Channel], units: Sequence[str]) -> list[str]:
    """Names of channels with one of some units, where a formula can say them."""
    # a pure number and a frequency are no angle and no speed, though their dimensions are alike
    return [
        c.name
        for c in channels
        if any(compatible(c.unit, unit) and ("rad" in c.unit) == ("rad" in unit) for unit in units)
        and re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[\d+\])*", c.name)
    ]


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
        load=None if work.load == 0.0 else LoadSpec(work.load, centre=(0.0, 0.0, 0.0)),
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
