"""Which signal tells which parameter: from the model's own derivatives, not only from the file.

A parameter is seen by a signal where changing it changes the signal. It is mapped **directly**
where the signal is the parameter itself, and **indirectly, through physics**, where it is one of
several things that make the signal. What changes no signal cannot be observed, and what acts only
together with others cannot be told from them (`evertwin.tuning.intervals.identifiability`).

A **virtual sensor** is a quantity inside a component that the model computes from what is measured:
here, the part of a signal that a component makes.

>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> import numpy as np
>>> v = np.linspace(-1, 1, 50)[:, None]
>>> axis = FunctionModel(
...     lambda x, u, dt, p: ([], [p[0] * np.sign(u[0]), p[1]]),
...     Layout.of(speed="rad/s"), Layout.of(torque="Nm", temperature="K"),
...     parameters=Parameters.of(Fc=(9.0, "Nm"), T=(300.0, "K"), spare=(1.0, "1")))
>>> rows = make_block(t=np.arange(50), u=v, y=np.tile([9.0, 300.0], (50, 1)))
>>> for one in links(Problem(axis, (rows,))):
...     print(one.parameter, [(s.signal, s.how) for s in one.signals])
Fc [('torque', 'indirect')]
T [('temperature', 'direct')]
spare []
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.compile import ModelPlan
from evertwin.engineering.parts import Component
from evertwin.engineering.sensitivity import counted
from evertwin.models import LinearModel
from evertwin.tuning import Problem
from evertwin.types import Float64

NOTHING = 1e-9
"""Effect below which a signal does not see a parameter."""


class Signal(NamedTuple):
    """A signal that sees a parameter.

    >>> Signal("tau1", "indirect", 0.3).effect
    0.3
    """

    signal: str
    how: Literal["direct", "indirect"]
    effect: float
    """rms change of the signal for a change by the parameter's natural size, over its own rms; at
    most 1 for a parameter whose value is 0: nothing but its bounds says how large it may be."""


class Link(NamedTuple):
    """A parameter and the signals that see it.

    >>> Link("Fc1", ()).signals
    ()
    """

    parameter: str
    signals: tuple[Signal, ...]
    """Strongest first; empty: it cannot be observed."""


class Inside(NamedTuple):
    """A virtual sensor: a quantity inside a component.

    >>> Inside("gearbox 1", "friction", 7.0, "Nm").rms
    7.0
    """

    component: str
    quantity: str
    rms: float
    """Root mean square over the rows."""
    unit: str


class Virtual(NamedTuple):
    """A virtual sensor: the part of a signal that a component makes.

    >>> Virtual("gearbox 1", "tau1", 11.0, 0.8, "Nm").share
    0.8
    """

    component: str
    signal: str
    rms: float
    """Root mean square of the part, in the signal's unit."""
    share: float
    """… over the rms of the signal."""
    unit: str


def links(problem: Problem) -> tuple[Link, ...]:
    """Every tuned parameter with the outputs that see it."""
    j = problem.jacobian(problem.start)
    on, rms = counted(problem), _rms(problem)
    acts = np.sqrt(np.mean(np.where(on[:, :, None], np.square(j), 0.0), axis=0))
    effect = acts * problem.sizes / rms[:, None]
    effect = np.where(problem.start == 0.0, np.minimum(effect, 1.0), effect)
    lone = (effect > NOTHING).sum(axis=1) == 1
    out = []
    for k, name in enumerate(problem.names):
        found = []
        for o in np.flatnonzero(effect[:, k] > NOTHING).tolist():
            own = lone[o] and bool(np.allclose(j[on[:, o], o, k], 1.0, atol=1e-6))
            how: Literal["direct", "indirect"] = "direct" if own else "indirect"
            found.append(Signal(problem.model.outputs.names[o], how, float(effect[o, k])))
        out.append(Link(name, tuple(sorted(found, key=lambda one: -one.effect))))
    return tuple(out)


def virtual_sensors(
    problem: Problem, parts: Sequence[Component], breakdown: Breakdown
) -> list[Virtual]:
    """The part of each output that each component's parameters make, as far as it is linear."""
    model = problem.model
    if not isinstance(model, LinearModel):
        return []
    linear = {model.parameters.names[c] for c in model.columns.ravel().tolist() if c >= 0}
    j = problem.jacobian(problem.start)
    on, rms = counted(problem), _rms(problem)
    out = []
    for part in parts:
        named = [breakdown.parameter_name(part, name) for name in part.parameters]
        own = [k for k, name in enumerate(problem.names) if name in named and name in linear]
        made: Float64[np.ndarray, "n ny"] = j[:, :, own] @ problem.start[own]
        for o, channel in enumerate(model.outputs):
            size = float(np.sqrt(np.mean(np.square(made[on[:, o], o])))) if on[:, o].any() else 0.0
            if size > NOTHING * rms[o]:
                out.append(Virtual(part.name, channel.name, size, size / rms[o], channel.unit))
    return out


def inside(plan: ModelPlan, breakdown: Breakdown, problem: Problem) -> list[Inside]:
    """The quantities inside components that the file names, over the rows of the problem."""
    if plan.kind != "assembly":
        return []
    made = {built.component for built in plan.built}
    asked = [
        (place.component.name, name)
        for place in breakdown.studied
        for name in place.component.virtual
        if place.component.name in made
    ]
    sensors = [f"{part}.{name}" for part, name in asked]
    if not sensors:
        return []
    model = replace(plan, options={**plan.options, "sensors": tuple(sensors)}).model(
        breakdown.folder
    )
    known = problem.parameters
    p = model.parameters.with_values(dict(zip(known.names, known.values.tolist(), strict=True)))
    found = np.concatenate(
        [model.simulate(model.initial(p.values), w.u, w.dt, p.values)[1] for w in problem.windows]
    )
    out = []
    for (part, name), sensor in zip(asked, sensors, strict=True):
        k = model.outputs.index(sensor)
        rms = float(np.sqrt(np.nanmean(np.square(found[:, k]))))
        out.append(Inside(part, name, rms, model.outputs.units[k]))
    return out


def file_against_model(
    breakdown: Breakdown, part: Component, found: Sequence[Link], channels: Sequence[str]
) -> tuple[str, ...]:
    """Where the sensors that the file names and those that the model shows differ, in sentences."""
    named = {breakdown.parameter_name(part, name) for name in part.parameters}
    seen = {s.signal for link in found if link.parameter in named for s in link.signals}
    said = set(part.sensors)
    out = [
        f"{signal} sees {part.name} by the model, the file does not name it"
        for signal in sorted(seen - said)
        if said
    ]
    unknown = sorted(said - set(channels))
    out += [f"{name} is named for {part.name}, the model has no such channel" for name in unknown]
    return tuple(out)


def _rms(problem: Problem) -> np.ndarray:
    """rms of each measured output over the rows that count, (ny,); 1 where it is zero."""
    on = counted(problem)
    rows = np.maximum(on.sum(axis=0), 1)
    size = np.sqrt(np.where(on, np.square(np.nan_to_num(problem.rows.y)), 0.0).sum(axis=0) / rows)
    return np.where(size > 0, size, 1.0)
