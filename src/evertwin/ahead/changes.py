"""What a scenario changes: model, parameters and the inputs to come. Each change is one function.

A `Case` is all that a simulation needs. A scenario is its changes, one after the other, on the case
of today; nothing of today is touched.

A new path is inputs to come: from a file (`evertwin.ahead.planned`), which may hold outputs as they
are meant to be, or from the moves of an arm.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.ahead.basis import Basis, Future
from evertwin.ahead.planned import rows_of_file
from evertwin.ahead.spec import LoadSpec, PathSpec, ScenarioSpec
from evertwin.errors import ConfigError, UsageError
from evertwin.machines.arm.chain import Chain
from evertwin.machines.arm.inertia import NAMES, point
from evertwin.machines.assembly.path import Limits, moves_of, plan
from evertwin.models import Model
from evertwin.models.corrected.corrected import Corrected, build
from evertwin.settings.quantity import own
from evertwin.setup.configured_model import model_of
from evertwin.signals import Layout
from evertwin.signals.units import compatible
from evertwin.types import ParameterVector

ACCELERATION = 2.0
"""Highest acceleration of a joint where nothing is said [rad/s²]."""
SPEED = 3.0
"""Highest speed of a joint that the description does not limit [rad/s]."""


def inner(model: Model) -> Any:
    """The machine's own model, without the correction terms around it."""
    found: Any = model
    while isinstance(found, Corrected):
        found = found.model
    return found


def chain_of(model: Model) -> Chain | None:
    """The geometry of an arm, or of an assembly around one; None for other machines."""
    model = inner(model)
    found = getattr(model, "chain", None) or getattr(getattr(model, "train", None), "chain", None)
    return found if isinstance(found, Chain) else None


def motion_of_moves(path: PathSpec, chain: Any, start: Sequence[float], inputs: Layout) -> Future:
    """The motion through an arm's moves as inputs to come."""
    top = [speed if math.isfinite(speed) else SPEED for _, _, speed in chain.limits]
    limits = Limits(path.speed or tuple(top), path.acceleration or (ACCELERATION,) * chain.n)
    program: Any = path.moves
    motion = plan(moves_of(program), start, limits, path.rate, path.profile, chain)
    u = np.concatenate([motion.q, motion.qd, motion.qdd], axis=1)
    names = [name.removesuffix("_set") for name in inputs.names]
    if not all(name.lstrip("qd").isdigit() for name in names):
        raise UsageError(
            f"path: moves tell the motion of joints, and this model also takes "
            f"{', '.join(n for n in names if not n.lstrip('qd').isdigit())}: give a file"
        )
    columns = [("q", "qd", "qdd").index(name.rstrip("0123456789")) * chain.n
               + int(name.lstrip("qd")) - 1 for name in names]  # fmt: skip
    return Future(np.ascontiguousarray(u[:, columns]), np.full(len(u), 1.0 / path.rate))


@dataclass(frozen=True)
class Case:
    """A model, its values, and what it will be told.

    >>> Case.__name__
    'Case'
    """

    model: Model
    p: ParameterVector
    sigma: ParameterVector
    """Standard deviations of the values, (np,)."""
    future: Future
    planned: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Outputs as they are meant to be, where a path says so."""


def changed(basis: Basis, case: Case, scenario: ScenarioSpec) -> Case:
    """The case with every change of a scenario but wear, which needs the lives.

    Raises:
        UsageError: a change that this machine cannot have.
        DataError: a path that cannot be read.
    """
    if scenario.path is not None:
        case = _path(basis, case, scenario.path, Path(scenario.folder))
    if scenario.speed is not None:
        case = faster(case, scenario.speed.factor)
    if scenario.load is not None:
        case = loaded(basis, case, scenario.load)
    for name, values in scenario.components.items():
        case = replaced(basis, case, name, values)
    for pattern, change in scenario.parameters.items():
        names = fnmatch.filter(case.model.parameters.names, pattern)
        if not names:
            case.model.parameters.index(pattern)  # names the nearest one
        for name in names:
            old = float(case.p[case.model.parameters.index(name)])
            new = change.value
            if new is None:
                new = old * change.factor if change.factor is not None else old + (change.add or 0)
            case = _set(case, {name: new})
    return case


def _set(case: Case, values: Mapping[str, float]) -> Case:
    """Other values, exactly known, inside the model's bounds."""
    p, sigma = case.p.copy(), case.sigma.copy()
    for name, value in values.items():
        item = case.model.parameters[name]
        value = own(name, value, item.unit)
        if not item.low <= value <= item.high:
            raise UsageError(
                f"scenario: {name} = {value:g} {item.unit} is outside [{item.low:g}, "
                f"{item.high:g}]: change it, or the bounds in the twin file"
            )
        at = case.model.parameters.index(name)
        p[at], sigma[at] = value, 0.0
    return replace(case, p=p, sigma=sigma)


def faster(case: Case, factor: float) -> Case:
    """The same motion in 1/factor of the time: speeds times it, accelerations times its square.

    Raises:
        UsageError: an input is no motion (a voltage, a temperature).
    """
    powers = []
    for channel in case.model.inputs:
        units = enumerate((("rad", "m"), ("rad/s", "m/s"), ("rad/s**2", "m/s**2")))
        found = [k for k, pair in units if any(compatible(channel.unit, unit) for unit in pair)]
        if not found or channel.unit == "1":  # a share is no angle
            raise UsageError(
                f"speed: the input {channel.name} [{channel.unit}] is no motion, so it is not known"
                " how it follows the speed: give a path with its course instead"
            )
        powers.append(found[0])
    u = case.future.u * factor ** np.array(powers, dtype=np.float64)
    planned = {} if not case.planned else dict(case.planned)
    return replace(case, future=Future(u, case.future.dt / factor), planned=planned)


def loaded(basis: Basis, case: Case, load: LoadSpec) -> Case:
    """The tip carries a mass in one point; a point that nobody states is anywhere near.

    Raises:
        UsageError: the machine is no arm.
    """
    names = [f"payload.{name}" for name in NAMES]
    centre = np.array(load.centre or (0.0, 0.0, 0.0))
    values = dict(zip(names, point(load.mass, centre).tolist(), strict=True))
    if names[0] not in case.model.parameters.names:
        case = _with_payload(basis, case)
    case = _set(case, values)
    sigma = case.sigma.copy()
    sigma[case.model.parameters.indices(names[1:4])] = load.mass * load.loose
    return replace(case, sigma=sigma)


def _with_payload(basis: Basis, case: Case) -> Case:
    spec = basis.setup.spec
    options: dict[str, Any] = dict(spec.model.options)
    if spec.model.kind == "assembly" and chain_of(basis.setup.model) is not None:
        lines: Any = options.get("components", ())
        options["components"] = [*lines, {"name": "payload", "kind": "payload"}]
    else:
        options["payload"] = True
    try:
        base = model_of(replace(spec, model=replace(spec.model, options=options)))
    except (UsageError, ConfigError) as error:
        raise UsageError(
            f"load: a model of kind {spec.model.kind!r} carries no payload: change its mass under "
            "parameters"
        ) from error
    model: Model = build(base, basis.version.form)
    old = dict(zip(case.model.parameters.names, case.p.tolist(), strict=True))
    spread = dict(zip(case.model.parameters.names, case.sigma.tolist(), strict=True))
    sigma = np.array([spread.get(name, 0.0) for name in model.parameters.names])
    return replace(case, model=model, p=model.parameters.with_values(old).values, sigma=sigma)


def replaced(basis: Basis, case: Case, component: str, values: Mapping[str, float]) -> Case:
    """A new component: with these values, or without any with those of the twin file.

    Raises:
        UsageError: no indicator names the component, so its parameters are not known.
    """
    if values:
        return _set(case, values)
    rules = [i for i in basis.setup.spec.indicator if (i.component or i.name) == component]
    names = [i.parameter for i in rules if i.parameter is not None]
    if not names:
        known = sorted({i.component or i.name for i in basis.setup.spec.indicator if i.parameter})
        raise UsageError(
            f"components: the parameters of {component!r} are not known: give its new values, or "
            f"an [[indicator]] with a parameter for it; known are {', '.join(known) or 'none'}"
        )
    return _set(case, {name: basis.setup.model.parameters[name].value for name in names})


def _path(basis: Basis, case: Case, path: PathSpec, folder: Path) -> Case:
    if path.file is not None:
        step = float(np.median(case.future.dt))
        future, planned = rows_of_file(basis, folder / path.file, step)
        return replace(case, future=future, planned=planned)
    chain = chain_of(basis.setup.model)
    if chain is None:
        raise UsageError("path: moves are those of an arm; for another machine give a file")
    n = chain.n
    start = path.start or tuple(case.future.u[-1, :n].tolist())
    future = motion_of_moves(path, chain, start, case.model.inputs)
    return replace(case, future=future, planned={})
