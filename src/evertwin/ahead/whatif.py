"""What if: a scenario beside today, simulated with the live version over the same time.

The baseline is the newest recorded task, done again. A scenario changes speed, load, path,
parameters or components, or lets everything wear until a date. Both are simulated alike, so that
their difference is the scenario's doing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from evertwin.ahead.basis import Basis, coming
from evertwin.ahead.changes import Case
from evertwin.ahead.path_error import followed
from evertwin.ahead.planned import beyond, off_beyond
from evertwin.ahead.simulated import PathError, Simulated, simulated
from evertwin.ahead.spec import ScenarioSpec
from evertwin.ahead.spread import Spread, spread
from evertwin.errors import DataError
from evertwin.fold import Block, plain, take
from evertwin.rows.channels import recorded_as
from evertwin.rows.feed import Data
from evertwin.setup.evaluation import judged
from evertwin.setup.newest import state_after
from evertwin.signals.units import from_si
from evertwin.types import Json, StateVector

LIKELY = 0.025
"""Probability from which on a limit may be passed."""
DERIVATIVES = ("derivative", "slope")
AS_TODAY = " (the baseline passes it too)"


@dataclass(frozen=True)
class Today:
    """The case that a scenario is held against.

    >>> Today.__name__
    'Today'
    """

    case: Case
    x: StateVector
    """State before its first row."""
    newest: StateVector
    """State after the newest row: where a new path begins."""
    spread: Spread
    rows: tuple[Block, ...]
    """The recordings."""


@dataclass(frozen=True)
class WhatIf:
    """The outcome of `Twin.whatif`.

    >>> found = WhatIf("robot", "as", 0, Simulated(1.0, {}), Simulated(2.0, {}))
    >>> print(found)
    robot, version 0 (as configured), scenario 'as': 2 s, baseline 1 s; (95 % of what is measured)
      no limit is passed
    >>> found.findings
    ()
    """

    name: str
    scenario: str
    version: int
    before: Simulated
    """The baseline."""
    after: Simulated
    """The scenario."""
    worn: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Parameters that wear has moved: from, to, and the interval at the date."""
    lives: Mapping[str, Mapping[str, Json]] = field(default_factory=dict)
    """Life of each component as it is and under the scenario's work."""
    docking: Mapping[str, Json] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    """What could not be told, and what it needs."""
    recorded: Mapping[str, str] = field(default_factory=dict)
    """The unit in which a channel is recorded, where it has one: text is in it, the rest in SI."""

    @property
    def findings(self) -> tuple[str, ...]:
        """Limits that the scenario passes, one sentence each."""
        today = {one.channel for one in self.before.exceeded}
        said = [
            f"{one.channel} reaches {self._in(one.channel, one.unit, one.value)} at {one.at:.3g} s,"
            f" limit {self._in(one.channel, one.unit, one.limit)}"
            f"{AS_TODAY * (one.channel in today)}"
            for one in self.after.exceeded
        ]
        sure = {one.channel for one in self.after.exceeded}
        for name, size in self.after.outputs.items():
            if size.limit is None or size.chance is None or size.chance <= LIKELY or name in sure:
                continue
            old = self.before.outputs.get(name)
            passed = name in today or (old is not None and (old.chance or 0.0) > LIKELY)
            may = "passes" if size.chance > 1.0 - LIKELY else "may pass"
            said.append(
                f"{name} stays at {self._in(name, size.unit, size.peak)} in the simulation; with "
                f"what predictions are off by it {may} its limit "
                f"{self._in(name, size.unit, size.limit)} (probability {size.chance:.2g})"
                f"{AS_TODAY * passed}"
            )
        if self.docking.get("holds") is False:
            said.append("the docking leaves its tolerance")
        return tuple(said)

    def _in(self, name: str, unit: str, value: float, *, bare: bool = False) -> str:
        """A value of a channel in the unit that it is recorded in."""
        told = self.recorded.get(name) or unit
        return f"{from_si(value, told):.4g}{'' if bare else f' {told}'}"

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.whatif/1"``."""
        content: dict[str, Any] = {
            "schema": "evertwin.whatif/1", "name": self.name, "scenario": self.scenario,
            "version": self.version, "baseline": _content(self.before),
            "with_scenario": _content(self.after), "change": self._change(), "worn": self.worn,
            "lives": self.lives, "docking": self.docking or None, "findings": self.findings,
            "notes": self.notes,
        }  # fmt: skip
        return plain(content)  # type: ignore[return-value]

    def _change(self) -> dict[str, dict[str, float | None]]:
        """Relative change of each output but temperatures, whose zero tells nothing of a size."""
        found = {}
        for name, new in self.after.outputs.items():
            old = self.before.outputs.get(name)
            if old is not None and new.unit != "K":
                found[name] = {"rms": _ratio(new.rms, old.rms), "peak": _ratio(new.peak, old.peak)}
        return found

    def __str__(self) -> str:
        """A table of outputs, then everything else."""
        configured = " (as configured)" if self.version == 0 else ""
        lines = [
            f"{self.name}, version {self.version}{configured}, scenario {self.scenario!r}: "
            f"{self.after.seconds:.4g} s, baseline {self.before.seconds:.4g} s; "
            "(95 % of what is measured)"
        ]
        for name, new in self.after.outputs.items():
            old = self.before.outputs[name]
            was, rms, before, peak, low, high = (
                self._in(name, new.unit, one, bare=True)
                for one in (old.rms, new.rms, old.peak, new.peak, *new.peak95)
            )
            told = self.recorded.get(name) or new.unit
            # the rms of a temperature in K is none in degC
            size = f"rms {was:>9} -> {rms:>9} " if told == "K" or new.unit != "K" else ""
            lines.append(
                f"  {name:<10} {size}{told:<6} peak {before:>9} -> {peak:>9} ({low} … {high})"
            )
        lines += [
            f"  path error of {name}: rms {_within(e.rms, e.rms95)}, largest "
            f"{_within(e.largest, e.largest95)}, at the end {_within(e.end, e.end95)} "
            f"{e.unit}{_where(e)}"
            for name, e in self.after.path_error.items()
        ]
        lines += [
            f"  {name} wears from {w['from']:.4g} to {w['to']:.4g} ({w['low95']:.4g} … "
            f"{w['high95']:.4g})"
            for name, w in self.worn.items()
        ]
        lines += [f"  life of {name}: {one['sentence']}" for name, one in self.lives.items()]
        if self.docking:
            lines.append(f"  docking: {self.docking['sentence']}")
        lines += [f"  {note}" for note in self.notes]
        lines += [f"  ! {said}" for said in self.findings] or ["  no limit is passed"]
        return "\n".join(lines)


def _ratio(new: float, old: float) -> float | None:
    return new / old - 1.0 if old > 0.0 else None


def _within(value: float, interval: tuple[float, float] | None) -> str:
    """A value with its interval, where it has one."""
    if interval is None or interval[0] == interval[1]:
        return f"{value:.4g}"
    return f"{value:.4g} ({interval[0]:.4g} … {interval[1]:.4g})"


def _where(error: PathError) -> str:
    """Where and when it is largest, of a tool."""
    if error.at is None:
        return ""
    place = ", ".join(f"{x:.3f}" for x in error.where)
    return f"; largest at {error.at:.3g} s, at ({place}) m"


def _error(error: PathError) -> dict[str, Any]:
    """Without its course, which belongs into a picture."""
    return {k.name: getattr(error, k.name) for k in fields(error) if k.name not in ("t", "size")}


def _content(one: Simulated) -> dict[str, Any]:
    return {
        "seconds": one.seconds, "outputs": one.outputs, "exceeded": one.exceeded,
        "path_error": {name: _error(e) for name, e in one.path_error.items()},
        "friction_work": one.work,
    }  # fmt: skip


def today(basis: Basis, data: Data = None, horizon: float | None = None) -> Today:
    """The newest recorded task, to be done again; up to ``horizon`` [s].

    Raises:
        DataError: there are no recordings, or they are too short.
    """
    rows = basis.rows(data)
    calm = tuple(_calm(basis, one) for one in rows)
    last = calm[-1]
    if len(last.t) < 3:
        raise DataError("what if: expected a recorded task of three rows or more")
    length = float(last.t[-1] - last.t[0]) * 1e-9
    model, p = basis.model, basis.p
    if horizon is None or horizon >= length:
        future = coming(last, length if horizon is None else horizon, "repeat")
        first = take(last, 0, 1)
    else:
        begin = int(np.searchsorted(last.t, last.t[-1] - horizon * 1e9, side="right"))
        first = take(last, 0, max(begin, 1))
        future = coming(last, horizon, "repeat")
    known = spread(model, p, basis.alike(calm), float(future.t[-1]))
    start, newest = (state_after(model, p, part) for part in (first, last))
    return Today(Case(model, p, basis.sigma, future), start, newest, known, rows)


def _calm(basis: Basis, rows: Block) -> Block:
    """Rows of a static map, with inputs that are derivatives filtered as the twin file filters what
    it compares: what these are noisy by is no motion of the machine, and would grow with the square
    of its speed."""
    smooth, inputs = basis.setup.smooth_window, basis.model.inputs
    spec = basis.setup.spec
    derived = {one.name for one in spec.derive if one.op in DERIVATIVES}
    noisy = [k for k, name in enumerate(inputs.names) if recorded_as(spec, name) in derived]
    if smooth is None or len(basis.model.states) or not noisy:
        return rows
    u = rows.u.copy()
    filtered = smooth(u[:, noisy])
    u[:, noisy] = np.where(np.isfinite(filtered), filtered, u[:, noisy])
    return rows._replace(u=u)


def beside(basis: Basis, now: Today, scenario: ScenarioSpec, after: Case) -> WhatIf:
    """Both cases simulated."""

    def run(case: Case, x: StateVector) -> Simulated:
        known = x if len(x) == len(case.model.states) else None
        start = case.model.initial(case.p) if known is None else known
        off = off_beyond(
            basis, now.rows, case.future,
            lambda told: case.model.simulate(start, told.u, told.dt, case.p)[1],
        )  # fmt: skip
        return simulated(case, known, now.spread, scenario.limits, off)

    start = now.x if scenario.path is None else now.newest
    outcome, notes, as_is = run(after, start), tuple[str, ...](), run(now.case, now.x)
    if scenario.path is not None:
        errors, notes = followed(basis, after, scenario.path, scenario.limits)
        outcome = replace(outcome, path_error={**outcome.path_error, **errors})
    return WhatIf(
        basis.setup.spec.name, scenario.name, basis.champion, as_is, outcome,
        notes=(
            *_misfit(basis, now), *notes, *_unstated(scenario),
            *beyond(basis, now.rows, after.future),
        ),
        recorded=basis.recorded,
    )  # fmt: skip


def _unstated(scenario: ScenarioSpec) -> tuple[str, ...]:
    """That nobody says where the load's centre is."""
    loose = 0.0 if scenario.load is None else scenario.load.loose
    said = "where the load's centre is nobody says: intervals hold with it"
    return (f"{said} {loose:.2g} m (rms) off the tip; state [load] centre",) if loose else ()


def _misfit(basis: Basis, now: Today) -> tuple[str, ...]:
    """That the live version does not fit the recordings, where it does not: by which output."""
    setup, alike = basis.setup, basis.alike(now.rows)
    if not setup.decides:
        return ()
    whole = now.rows[len(now.rows) - len(alike) :]
    skip = len(whole[0].t) - len(alike[0].t)
    off = judged(setup, basis.model, basis.p, whole, skip)
    for k, channel in enumerate(basis.model.outputs):
        if setup.watched[k] and off[k] > setup.requirement:
            tuned = "does not fit" if basis.champion else "was never tuned and does not fit"
            return (
                f"version {basis.champion} {tuned} these recordings: {channel.name} is off by "
                f"{setup.shown(k, float(off[k]))}, which all figures contain",
            )
    return ()
