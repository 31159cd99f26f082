"""The whole method on one machine: from its breakdown and recordings to what is tuned, how often.

Nothing is written and nothing runs live here: a `Study` is the record of every choice with its
reason and figures. The order is that of Aivaliotis, Arkouli, Georgoulias, Makris (2023): critical
components, depth of their models, signals to parameters, sensitivity, editable set, weights.

Initial values by experiment: a first fit to the recordings, once, before anything is chosen.

Data sheets give ratios and inertias of rotors; what they do not give (inertias of links, offsets,
friction of a robot whose maker is silent) is found from recordings that excite it. Those values are
written into the twin file with their source; whether they are tuned later is another question.

>>> from evertwin.engineering.breakdown import Breakdown
>>> from evertwin.engineering.parts import Requirements
>>> asked(Breakdown("arm", requirements=Requirements(identify=("links.*",))), ("links.m", "J"))
('links.m',)
"""

from __future__ import annotations

import fnmatch
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.choice import Chosen, Question, choose, questions, spans_of
from evertwin.engineering.compile import ModelPlan, compile_model
from evertwin.engineering.criticality import Criticality, history_of, rank
from evertwin.engineering.health import limits_against_values
from evertwin.engineering.level import LevelChoice, level_of
from evertwin.engineering.mapping import (
    Inside,
    Link,
    Virtual,
    file_against_model,
    inside,
    links,
    virtual_sensors,
)
from evertwin.engineering.sensitivity import Morris, few, morris
from evertwin.engineering.weights import Measured, Weighed, measure, weigh
from evertwin.errors import ConfigError
from evertwin.fold import plain
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.intervals.assemble import squares
from evertwin.types import Json


@dataclass(frozen=True)
class Found:
    """One initial value.

    >>> Found("links.mx", 0.3, 0.01, "kgm", "identifiable").source
    'experiment: first fit to these recordings, ± 0.01 kgm'
    """

    name: str
    value: float
    sigma: float
    unit: str
    verdict: str

    @property
    def source(self) -> str:
        """What the twin file says of it."""
        return f"experiment: first fit to these recordings, ± {self.sigma:.2g} {self.unit}"


@dataclass(frozen=True)
class Identified:
    """Initial values that a first fit found.

    >>> Identified((), {}, {}).found
    ()
    """

    found: tuple[Found, ...]
    """Those that the recordings determine; the others keep what they had."""
    before: dict[str, float]
    """Relative deviation of each output, moving, at the values stated."""
    after: dict[str, float]
    """The same after the first fit."""


def asked(breakdown: Breakdown, known: Sequence[str]) -> tuple[str, ...]:
    """The parameters that a first fit is to find: by pattern, or with source but without value.

    Args:
        known: the model's parameters.

    Raises:
        ConfigError: a pattern matches none of them.
    """
    first = [(one.name, one.said) for one in breakdown.stated]
    wanted = {name for name, said in first if said.value is None and said.source == "experiment"}
    for pattern in breakdown.requirements.identify:
        matched = fnmatch.filter(known, pattern)
        if not matched:
            raise ConfigError(
                f"[requirements] identify: no parameter matches {pattern!r}; the model has "
                f"{', '.join(known)}"
            )
        wanted |= set(matched)
    return tuple(name for name in known if name in wanted)


def identify(problem: Problem, wanted: Sequence[str], drifting: Sequence[str]) -> Identified:
    """Fits the wanted parameters together with those that drift.

    Args:
        problem: model and rows.
        wanted: see `asked`.
        drifting: parameters whose stated values may be off; fitted along, so that the others do not
            take their part.
    """
    names = tuple(dict.fromkeys((*wanted, *drifting)))
    fit = solve(replace(problem, editable=names))
    rows = zip(fit.names, fit.values, fit.sigma, fit.units, fit.verdict, strict=True)
    found = tuple(
        Found(name, float(value), float(sigma), unit, verdict)
        for name, value, sigma, unit, verdict in rows
        if name in wanted and verdict != "not"
    )
    before = dict(zip(fit.outputs, map(float, fit.moving_before), strict=True))
    return Identified(
        found, before, dict(zip(fit.outputs, map(float, fit.moving_after), strict=True))
    )


@dataclass(frozen=True)
class Study:
    """Every choice with its reason. Built by `study`.

    >>> Study.__name__
    'Study'
    """

    breakdown: Breakdown
    ranks: tuple[Criticality, ...]
    """Most critical first."""
    levels: tuple[LevelChoice, ...]
    """In the order of ``ranks``."""
    links: tuple[Link, ...]
    virtual: tuple[Virtual, ...]
    """The part of each signal that a component makes."""
    inside: tuple[Inside, ...]
    """Quantities inside components that the file names."""
    identified: Identified | None
    """Initial values that a first fit found; None: none were asked for."""
    notes: tuple[str, ...]
    """Where the file and the model disagree about sensors, and what is modelled without need."""
    questions: tuple[Question, ...]
    morris: Morris
    chosen: Chosen
    weighed: Weighed | None
    """None: nothing is tuned."""
    measured: Measured | None
    """What the schedule saves and costs; None: nothing is tuned, or it was not tried."""
    reached: dict[str, float]
    """Relative deviation of each output, moving: as tuned, or as stated where nothing is."""
    rows: int
    """Rows of the recordings."""
    seconds: float

    @property
    def run_time(self) -> float | None:
        """Run time of one tuning of everything [s]; None: nothing is tuned."""
        found = self.measured
        return None if found is None else found.seconds_all / found.tunings

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.engineer/1"``."""
        needs = self.breakdown.requirements
        links = [(one.parameter, [s._asdict() for s in one.signals]) for one in self.links]
        content: Any = {
            "schema": "evertwin.engineer/1",
            "name": self.breakdown.name,
            "components": [
                {**vars(r), "level": v}
                for r, v in zip(self.ranks, self.levels, strict=True)
            ],
            "requirements": {
                "accuracy": needs.accuracy, "run_time": needs.run_time,
                "interval": needs.interval, "reached": self.reached,
                "run_time_reached": self.run_time,
                "met": self.met,
            },
            "links": [{"parameter": name, "signals": signals} for name, signals in links],
            "virtual_sensors": [one._asdict() for one in self.virtual],
            "inside": [one._asdict() for one in self.inside],
            "identified": self.identified
            and {
                "values": self.identified.found,
                "deviation_before": self.identified.before,
                "deviation_after": self.identified.after,
            },
            "notes": self.notes,
            "morris": _table(self.morris, ("mu", "spread")),
            "sobol": self.chosen.sobol
            and _table(self.chosen.sobol, ("share", "alone", "half", "effect")),
            "parameters": self.chosen.choices,
            "editable": self.chosen.editable,
            "schedule": self.weighed,
            "measured": self.measured
            and {
                **vars(self.measured), "saved": self.measured.saved,
                "saved_simulations": self.measured.saved_simulations, "lost": self.measured.lost,
            },
            "rows": self.rows,
            "seconds": self.seconds,
        }  # fmt: skip
        found = plain(content)
        assert isinstance(found, dict)
        return found

    @property
    def met(self) -> dict[str, bool]:
        """Requirement → is it met on these rows?"""
        needs = self.breakdown.requirements
        found = {"accuracy": max(self.reached.values()) <= needs.accuracy}
        if needs.run_time is not None and self.run_time is not None:
            found["run_time"] = self.run_time <= needs.run_time
        if self.measured is not None:
            found["accuracy by the schedule"] = (
                max(self.measured.deviation.values()) <= needs.accuracy
            )
        return found


def modelled(breakdown: Breakdown, known: Sequence[str]) -> tuple[str, ...]:
    """Names of the parameters of the study's components, as the model calls them.

    Args:
        known: the model's parameters; what is inside a black box is not among them.

    Raises:
        ConfigError: no component has a parameter of the model.
    """
    found = tuple(one.name for one in breakdown.stated if one.name in known)
    if not found:
        raise ConfigError(
            f"{breakdown.name}: no component has a parameter of the model: name some under "
            f"parameters; the model has {', '.join(known)}"
        )
    return found


def study(
    breakdown: Breakdown, problem: Problem, plan: ModelPlan | None = None, seed: int = 1,
    *, tried: bool = True,
) -> Study:  # fmt: skip
    """The method on the rows of ``problem``.

    Args:
        plan: what the breakdown was compiled into; None: it is compiled here.
        problem: on the parameters of `modelled`, with their initial values as prior.
        seed: of the samples.
        tried: also tune successive recordings by the schedule, to measure what it saves.

    Raises:
        ConfigError: a component lacks what the method needs to rank it.
        ModelError: a simulation inside a parameter's range diverged.
    """
    began = time.perf_counter()
    plan = compile_model(breakdown) if plan is None else plan
    ranks = rank(breakdown, history_of(breakdown))
    levels = tuple(level_of(breakdown.component(one.component), one.role) for one in ranks)
    short = few(problem)
    found = links(short)
    first = _first_fit(breakdown, problem, found)
    if first is not None:
        values = {one.name: one.value for one in first.found}
        problem = replace(problem, prior=problem.parameters.with_values(values))
        short = few(problem)
        found = links(short)
    posed = questions(breakdown, {one.component: one for one in levels}, found)
    parts = [place.component for place in breakdown.studied]
    channels = (problem.model.inputs + problem.model.outputs).names
    notes = [
        note
        for part in parts
        if part.parameters
        for note in file_against_model(breakdown, part, found, channels)
    ]
    chosen = choose(problem, posed, breakdown.requirements.negligible, seed)
    notes += limits_against_values(breakdown, chosen, problem)
    weighed, measured = None, None
    if chosen.fit is not None:
        own = replace(problem, editable=chosen.fit.names)
        weighed = weigh(own, chosen.fit, posed, breakdown.requirements)
        if tried:
            measured = measure(own, chosen.fit, posed, weighed, breakdown.requirements)
    return Study(
        breakdown, ranks, levels, found, tuple(virtual_sensors(short, parts, breakdown)),
        tuple(inside(plan, breakdown, problem)), first, tuple(notes), posed,
        morris(problem, spans_of(problem, posed), seed), chosen, weighed, measured,
        _reached(problem, chosen.fit), len(problem.rows.u), time.perf_counter() - began,
    )  # fmt: skip


def _reached(problem: Problem, fit: Fit | None) -> dict[str, float]:
    """Relative deviation of each output, moving, of what is tuned; of nothing as it is stated."""
    left = squares(problem, problem.first).relative_moving if fit is None else fit.moving_after
    return dict(zip(problem.model.outputs.names, left, strict=True))


def _first_fit(breakdown: Breakdown, problem: Problem, found: Sequence[Link]) -> Identified | None:
    """Initial values that the recordings are asked for."""
    wanted = asked(breakdown, problem.parameters.names)
    if not wanted:
        return None
    drifting = {one.name for one in breakdown.stated if one.drift > 0.0}
    seen = [link.parameter for link in found if link.signals]
    return identify(problem, wanted, [name for name in seen if name in drifting])


def _table(record: Any, keys: tuple[str, ...]) -> dict[str, Any]:
    """Output → parameter → figures."""
    table = {
        output: {
            name: {key: float(getattr(record, key)[o, k]) for key in keys}
            for k, name in enumerate(record.names)
        }
        for o, output in enumerate(record.outputs)
    }
    return {"samples": record.samples, "seconds": record.seconds, "outputs": table}
