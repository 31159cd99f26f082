"""From what an FMU says of itself to what a twin needs of it.

A twin goes back and forth: it starts predictions anew from what was measured, runs a challenger
beside the live model, tries parameters. `simulate` is therefore a pure function of the state that
it is given, and an FMU has to offer a way to be put there:

* model exchange: its continuous states are the state, and this side solves them;
* co-simulation with **start values**: the state is a set of variables that take start values; the
  FMU is initialised again wherever the state jumps, so position updates and fixed parameters reach
  it. The variables must be all that it remembers;
* co-simulation with **saved states** (get, set and serialise): the state is these bytes; named
  states beside them are set where a position update asks for it;
* co-simulation without memory: a static map, if the user says so.

An FMU that offers none of these is refused, and told what it would need.

Units as FMI writes them, and what they are in SI.

An FMU may define each unit by powers of base units, a factor and an offset; where it does, that is
believed. Where it names a unit only, the name is read as Modelica writes it (``N.m``, ``rad/s``,
``kg.m2``, ``degC``). Without any, the number is taken as it is, with the unit '1'.

>>> si_of("N.m", Unit("N.m", 1.0, 0.0, (("kg", 1), ("m", 2), ("s", -2))))
('Nm', 1.0, 0.0)
>>> si_of("deg", Unit("deg", 0.017453292519943295, 0.0, (("rad", 1),)))
('rad', 0.017453292519943295, 0.0)
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import ModelError, UsageError
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    Description,
    Interface,
    Unit,
    Variable,
)
from evertwin.models.fmu.options import Options
from evertwin.models.fmu.unit_names import spelled
from evertwin.models.parameters import Parameter, Parameters
from evertwin.signals.channels import Channel, Layout, position
from evertwin.signals.units import compatible, conversion, si_unit


def si_of(name: str, defined: Unit | None = None) -> tuple[str, float, float]:
    """(SI unit, factor, offset) with value in SI = factor · value + offset.

    Raises:
        UsageError: the unit is not known.
    """
    if not name:
        return "1", 1.0, 0.0
    written = spelled(name)
    if defined is None or defined.exponents is None:
        return si_unit(written), *conversion(written)
    base = _powers(defined)
    try:
        known = compatible(written, base)
    except UsageError:
        known = False
    return (si_unit(written) if known else base), defined.factor, defined.offset


def _powers(unit: Unit) -> str:
    parts = [f"{base}^{power}" if power != 1 else base for base, power in unit.exponents or ()]
    return "*".join(parts) or "1"


_MEMORY = {"none": at.STATIC, "start": at.START, "saved": at.SAVED}
_SOLVERS = {"euler": at.EULER, "heun": at.HEUN, "rk4": at.RUNGE_KUTTA}
_MILLISECOND = 1e-3
_SETTABLE = ("exact", "approx")
LARGEST = 1 << 16
"""Bytes of a saved state."""


@dataclass(frozen=True)
class Signals:
    """Variables as channels, with the way to their numbers.

    >>> Signals((), Layout(), at.Group((), (), (), 0)).layout.names
    ()
    """

    variables: tuple[Variable, ...]
    layout: Layout
    group: at.Group


@dataclass(frozen=True)
class Binding:
    """An FMU bound to a twin's inputs, outputs, states and parameters. `bind` builds it.

    >>> Binding.__name__
    'Binding'
    """

    where: str
    description: Description
    options: Options
    exchange: bool
    interface: Interface
    memory: int
    inputs: Signals
    outputs: Signals
    states: Signals
    """Named states, without clock and saved bytes."""
    starts: tuple[int, ...]
    """References that take the states' start values."""
    parameters: Parameters
    tuned: Signals

    @property
    def clock(self) -> bool:
        """Is the FMU's time part of the state?"""
        return self.options.clock or self.memory == at.SAVED

    def plan(self, platform: str) -> dict[str, Any]:
        """What the child process is told."""
        start = [
            (self.description.variables[name].reference, float(value))
            for name, value in self.options.start.items()
        ]
        raw = [(v - b) / a for v, a, b in zip(
            self.parameters.values.tolist(), self.tuned.group.factors, self.tuned.group.offsets
        )]  # fmt: skip
        return {
            "version": self.description.version, "token": self.description.token,
            "identifier": self.interface.identifier, "platform": platform,
            "interface": MODEL_EXCHANGE if self.exchange else CO_SIMULATION,
            "completes": self.interface.completes, "saves": self.memory == at.SAVED,
            "start_references": [reference for reference, _ in start],
            "start_values": [value for _, value in start],
            "parameters": list(self.tuned.group.references), "parameter_values": raw,
            "states": list(self.states.group.references), "starts": list(self.starts),
        }  # fmt: skip

    def layout(self, saved: int) -> Layout:
        """Channels of the state; ``saved`` bytes are packed into it, with room to grow."""
        added = [Channel("fmu.time", "s")] if self.clock else []
        if self.memory == at.SAVED:
            added += [Channel("fmu.bytes", "1")]
            added += [Channel(f"fmu.{k}", "1") for k in range(words_of(saved))]
        return self.states.layout + Layout(tuple(added))

    def page(self, saved: int) -> np.ndarray:
        """The page that rows are run by."""
        n, nx = len(self.states.layout), len(self.layout(saved))
        groups = self.inputs.group, self.outputs.group, self.states.group, self.tuned.group
        page = at.layout(groups, self.adopts, nx, self.description.indicators)
        page[at.MEMORY], page[at.SOLVER] = self.memory, _SOLVERS[self.options.solver]
        page[at.CLOCK] = n if self.clock else -1
        page[at.BYTES] = n + 1 if self.memory == at.SAVED else -1
        page[at.CAPACITY] = words_of(saved) + 1 if self.memory == at.SAVED else 0
        page[at.NZ] = self.description.indicators if self.exchange else 0
        numbers, q = page.view(np.float64), int(page[at.REALS])
        default = self.description.step
        longest = self.options.step or ((default or _MILLISECOND) if self.exchange else 0.0)
        numbers[q + at.STEP] = longest
        numbers[q + at.HOLD] = self.options.step or default or _MILLISECOND
        return page

    @property
    def adopts(self) -> list[tuple[int, int]]:
        """(output, state) that a position update connects: as said, of one name or reference."""
        outputs, states = self.outputs, self.states
        alone = _alone(outputs) and _alone(states)
        found = []
        for i, channel in enumerate(outputs.layout):
            wanted = self.options.adopts.get(channel.name)
            if wanted is not None:
                found.append((i, states.layout.index(wanted)))
                continue
            for j, state in enumerate(states.layout):
                same = alone and outputs.group.references[i] == states.group.references[j]
                if channel.name == state.name or (same and channel.unit == state.unit):
                    found.append((i, j))
                    break
        return found


def _alone(signals: Signals) -> bool:
    """Has every number a reference of its own?"""
    return len(signals.group.references) == signals.group.values


def words_of(saved: int) -> int:
    """Words of 48 bits for a saved state, with a quarter to grow.

    >>> words_of(60)
    23
    """
    return -(-(saved + saved // 4 + 60) // 6)


def bind(description: Description, options: Options, where: str) -> Binding:
    """Chooses interface, memory, variables and units.

    Raises:
        ModelError: the FMU cannot serve a twin that way; says what it would need.
        UsageError: an option names a variable that the FMU has not.
    """
    try:
        return _Binder(description, options).bound(where)
    except (ModelError, UsageError) as error:
        raise type(error)(f"{where}: {error}") from error


class _Binder(NamedTuple):
    """Reads a description as the options say."""

    description: Description
    options: Options

    def bound(self, where: str) -> Binding:
        description, options = self
        self.all(options.start)
        for name in (*options.units, *options.adopts, *options.angles):
            self.named(name if name in description.variables else name.split("[")[0])
        exchange, memory = self.interface()
        states, starts = self.states(memory)
        tuned = self.chosen("parameters", "parameter")
        if memory == at.SAVED:
            tuned = self.only_tunable(tuned)
        signals, parameters = self.parameters(tuned, where)
        outputs = self.chosen("outputs", "output")
        if not outputs and options.outputs is None:
            raise ModelError("the FMU has no outputs: name variables (outputs = [...])")
        return Binding(
            where, description, options, exchange,
            description.interfaces[MODEL_EXCHANGE if exchange else CO_SIMULATION], memory,
            self.signals(self.chosen("inputs", "input")), self.signals(outputs), states, starts,
            parameters, signals,
        )  # fmt: skip

    def interface(self) -> tuple[bool, int]:
        """(model exchange?, memory)."""
        there, options = self.description.interfaces, self.options
        wanted = options.interface
        if wanted and wanted not in there:
            raise ModelError(f"expected {wanted}, the FMU offers {', '.join(there)} only")
        if options.memory or (options.states is not None and not wanted):
            wanted = wanted or (CO_SIMULATION if CO_SIMULATION in there else MODEL_EXCHANGE)
        if wanted == MODEL_EXCHANGE or CO_SIMULATION not in there:
            return True, at.CONTINUOUS
        slave = there[CO_SIMULATION]
        if options.memory:
            if options.memory == "saved" and not (slave.saves and slave.serializes):
                raise ModelError(
                    "memory = 'saved' needs an FMU that gets, sets and serialises its state "
                    "(canGetAndSetFMUState, canSerializeFMUState): export it so, or name its states"
                )
            return False, _MEMORY[options.memory]
        if options.states is not None:
            return False, at.START if len(options.states) else at.STATIC
        states, variables = self.description.states, self.description.variables
        if states and all(variables[name].initial in _SETTABLE for name in states):
            return False, at.START
        if slave.saves and slave.serializes:
            return False, at.SAVED
        if MODEL_EXCHANGE in there and not wanted:
            return True, at.CONTINUOUS
        raise ModelError(
            "a twin goes back to earlier states, and this FMU offers no way to: name the "
            "variables that take start values and hold all of its memory (states = [...]), export "
            "it with get, set and serialise of its state or for model exchange, or say that it has "
            "no memory (memory = 'none')"
        )

    def states(self, memory: int) -> tuple[Signals, tuple[int, ...]]:
        """Named states, and the references that take their start values."""
        given, own = self.options.states, self.description.states
        if memory in (at.CONTINUOUS, at.STATIC):
            if given:
                has = (
                    "model exchange has its own" if memory == at.CONTINUOUS else "memory is 'none'"
                )
                raise UsageError(f"states: expected none, {has}")
            return self.signals(self.all(own if memory == at.CONTINUOUS else ())), ()
        names = tuple(given) if given is not None else own if memory == at.START else ()
        if memory == at.START and not names:
            raise UsageError("states: expected the variables that hold the memory, got none")
        variables = self.all(names)
        if any(variable.size > 1 for variable in variables):
            raise UsageError("states: expected variables with one number each")
        starts = given.values() if isinstance(given, dict) else names
        references = tuple(v.reference for v in self.all(starts)) if memory == at.START else ()
        return self.signals(variables), references

    def named(self, name: str) -> Variable:
        names = tuple(self.description.variables)
        return self.description.variables[names[position(names, name, "variable")]]

    def all(self, names: Iterable[str]) -> tuple[Variable, ...]:
        return tuple(self.named(name) for name in names)

    def chosen(self, what: str, causality: str) -> tuple[Variable, ...]:
        """Variables by name, or all of the causality."""
        given = getattr(self.options, what)
        if given is not None:
            return self.all(given)
        found = (v for v in self.description.variables.values() if v.causality == causality)
        return tuple(v for v in found if what != "parameters" or len(v.start) == v.size)

    def only_tunable(self, found: tuple[Variable, ...]) -> tuple[Variable, ...]:
        """With saved states a parameter has to act while the FMU runs."""
        fixed = [variable.name for variable in found if variable.variability != "tunable"]
        if self.options.parameters is not None and fixed:
            raise ModelError(
                "with saved states only tunable parameters can change, and "
                f"{', '.join(fixed)} are fixed: name states that take start values instead"
            )
        return tuple(variable for variable in found if variable.variability == "tunable")

    def signals(self, variables: tuple[Variable, ...]) -> Signals:
        channels, scales = list[Channel](), list[tuple[float, float]]()
        for variable in variables:
            unit, factor, offset = self.unit(variable)
            kind: Any = "angle" if variable.name in self.options.angles else "linear"
            low, high = sorted((variable.low * factor + offset, variable.high * factor + offset))
            if not low < high:
                low, high = -math.inf, math.inf
            for name in _names(variable):
                channels.append(Channel(name, unit, kind, low=low, high=high))
                scales.append((factor, offset))
        factors, offsets = tuple(a for a, _ in scales), tuple(b for _, b in scales)
        group = at.Group(tuple(v.reference for v in variables), factors, offsets, len(channels))
        return Signals(variables, Layout(tuple(channels)), group)

    def unit(self, variable: Variable) -> tuple[str, float, float]:
        units = self.options.units
        said = units.get(variable.name, variable.unit)
        try:
            known = self.description.units.get(said)
            return si_of(said, None if variable.name in units else known)
        except UsageError as error:
            raise ModelError(
                f"variable {variable.name!r} has a unit that is not known, {said!r}: say it "
                f'in options, units = {{ {variable.name!r} = "..." }}'
            ) from error

    def parameters(self, variables: tuple[Variable, ...], where: str) -> tuple[Signals, Parameters]:
        free = tuple(replace(variable, low=-math.inf, high=math.inf) for variable in variables)
        found: list[Parameter] = []
        for variable in variables:
            unit, factor, offset = self.unit(variable)
            editable = variable.variability == "tunable" or self.options.parameters is not None
            low, high = sorted((variable.low * factor + offset, variable.high * factor + offset))
            start = variable.start or (0.0,)
            if variable.name in self.options.start:
                start = (float(self.options.start[variable.name]),)
            if len(start) != variable.size:
                start = start[:1] * variable.size
            for name, value in zip(_names(variable), start, strict=True):
                try:
                    found.append(Parameter(name, value * factor + offset, unit, low, high,
                                           editable=editable, source=where))  # fmt: skip
                except UsageError as error:
                    raise ModelError(str(error)) from error
        return self.signals(free), Parameters(tuple(found))


def _names(variable: Variable) -> list[str]:
    """Elements of an array count from 1, as Modelica's do."""
    if variable.size == 1:
        return [variable.name]
    return [f"{variable.name}[{k + 1}]" for k in range(variable.size)]
