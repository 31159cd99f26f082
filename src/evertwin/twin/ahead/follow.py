"""How far an arm's tool is off a new path: the path given to its controllers as set-points.

The components of the twin, read forward: controller → motor → gearbox → structure, with the live
values. The arm first stands where the path starts, held by its controllers, and then follows. Two
errors are told: how far the tool is from where it should be at that time (``tool``), and how far
from the path itself (``tool, off the path``), which leaves out what is only late.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64

from evertwin.config.scenario import PathSpec
from evertwin.errors import UsageError
from evertwin.machines.arm.chain import Chain
from evertwin.machines.assembly.kinematics import tips
from evertwin.models import Model
from evertwin.models.corrected import build
from evertwin.twin.ahead.basis import Basis, draws
from evertwin.twin.ahead.changes import Case
from evertwin.twin.ahead.paths import chain_of
from evertwin.twin.ahead.simulated import PathError
from evertwin.twin.factory import model_of
from evertwin.types import Inputs, Intervals, Vector

__all__ = ["apart", "followed"]

DRAWS = 16
SETTLE = 1.0
"""How long the arm stands at the start before it moves [s]."""


class _Run(NamedTuple):
    u: Inputs
    dt: Intervals
    start: Vector
    rows: int
    """Rows of the path; those before them are the settling."""


def followed(
    basis: Basis, case: Case, path: PathSpec
) -> tuple[Mapping[str, PathError], tuple[str, ...]]:
    """Errors of the tool on a case's path; else what is missing, in a sentence.

    Raises:
        UsageError: components that cannot be joined or have no forward reading.
    """
    chain = chain_of(case.model)
    if chain is None:
        return {}, ()
    lacks = _lacking(basis, path, chain)
    if lacks:
        return {}, (lacks,)
    model = _forward(basis, path)
    old = dict(zip(case.model.parameters.names, case.p.tolist(), strict=True))
    spread = dict(zip(case.model.parameters.names, case.sigma.tolist(), strict=True))
    known = {name: value for name, value in old.items() if name in model.parameters.names}
    p = model.parameters.with_values(known).values
    sigma = np.array([spread.get(name, 0.0) for name in model.parameters.names])
    ps = p[None] if not sigma.any() else np.concatenate([p[None], draws(model, p, sigma, DRAWS, 3)])
    run = _set_points(case, model, chain.n)
    planned = tips(chain, run.u[-run.rows :, : chain.n])
    gone = np.stack([_tool(model, chain, run, one) for one in ps])
    if not np.isfinite(gone[0]).all():
        return {}, ("path error: the controllers do not hold the arm: change their gains",)
    gone = gone[np.isfinite(gone).all(axis=(1, 2))]
    t = np.cumsum(run.dt[-run.rows :])
    late = np.linalg.norm(gone - planned, axis=2)
    off = np.stack([apart(one, planned) for one in gone])
    notes = ("path error: without the terms that a correction has added",)
    return (
        {"tool": _told(late, planned, t), "tool, off the path": _told(off, planned, t)},
        notes if basis.version.form.terms else (),
    )


def _lacking(basis: Basis, path: PathSpec, chain: Chain) -> str:
    """What keeps the path error from being told; empty: nothing."""
    said = basis.setup.spec.model
    if said.kind != "assembly":
        return (
            f"path error: not told, a model of kind {said.kind!r} has no controllers: describe the "
            "arm by components (kind = 'assembly'; `evertwin engineer` does it from a breakdown)"
        )
    lines = _lines(basis, path)
    held = {line.get("axis") for line in lines if line.get("kind") == "controller"}
    missing = [str(j) for j in range(1, chain.n + 1) if j not in held]
    if missing:
        return (
            f"path error: not told, no controller on axis {', '.join(missing)}: add components = "
            '[{ name = "control1", kind = "controller", axis = 1, kp = …, kv = … }, …] to [path]'
        )
    return ""


def _lines(basis: Basis, path: PathSpec) -> list[Mapping[str, Any]]:
    """The twin's components and what the scenario adds; a planner gives way to the new path."""
    options: Mapping[str, Any] = basis.setup.spec.model.options
    own: Sequence[Mapping[str, Any]] = options.get("components", ())
    added: Any = path.components
    names = {line.get("name") for line in added}
    kept = [one for one in own if one.get("kind") != "path" and one.get("name") not in names]
    return [*kept, *added]


def _forward(basis: Basis, path: PathSpec) -> Model:
    spec = basis.setup.spec
    options: dict[str, Any] = {"reading": "forward", "components": _lines(basis, path)}
    if "step" in spec.model.options:
        options["step"] = spec.model.options["step"]
    try:
        base = model_of(replace(spec, signals={}, model=replace(spec.model, options=options)))
        return build(base, replace(basis.version.form, terms=()))
    except UsageError as error:
        raise UsageError(f"path error: {error}") from error


def _set_points(case: Case, model: Model, n: int) -> _Run:
    """Standing at the start, then the path, as inputs of the forward reading."""
    future = case.future
    names = [name.removesuffix("_set") for name in case.model.inputs.names]
    wanted = [name.removesuffix("_set") for name in model.inputs.names]
    unknown = [name for name in wanted if name not in names]
    if unknown:
        raise UsageError(f"path error: the path does not tell {', '.join(unknown)}")
    u = future.u[:, [names.index(name) for name in wanted]]
    dt = np.asarray(future.dt)
    step = float(np.median(dt))
    still = np.repeat(u[:1], max(round(SETTLE / step), 1), axis=0)
    still[:, n : 2 * n] = 0.0
    return _Run(
        np.ascontiguousarray(np.concatenate([still, u])),
        np.concatenate([np.full(len(still), step), dt]), u[0, :n], len(u),
    )  # fmt: skip


def _tool(model: Model, chain: Chain, run: _Run, p: Vector) -> Float64[np.ndarray, "n 3"]:
    """Where the tool is in each row of the path [m]."""
    y0 = np.full(len(model.outputs), np.nan)
    y0[: chain.n], y0[chain.n : 2 * chain.n] = run.start, 0.0
    x = model.observe(model.initial(p), y0)
    _, y = model.simulate(x, run.u, run.dt, p)
    return tips(chain, y[-run.rows :, : chain.n])


def apart(
    points: Float64[np.ndarray, "n 3"], path: Float64[np.ndarray, "m 3"]
) -> Float64[np.ndarray, " n"]:
    """Distance of each point from a path of straight pieces [m].

    >>> line = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    >>> apart(np.array([[1.3, 0.4, 0.3], [3.0, 0.0, 0.0]]), line).round(6).tolist()
    [0.5, 1.0]
    """
    found = np.full(len(points), np.inf)
    begin, way = path[:-1], np.diff(path, axis=0)
    length = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
    for part in np.array_split(np.arange(len(points)), max(len(points) // 256, 1)):
        here = points[part, None, :] - begin
        share = np.clip(np.einsum("nij,ij->ni", here, way) / length, 0.0, 1.0)
        gap = here - share[:, :, None] * way
        found[part] = np.sqrt(np.einsum("nij,nij->ni", gap, gap).min(axis=1))
    return found


def _told(
    size: Float64[np.ndarray, "k n"],
    planned: Float64[np.ndarray, "n 3"],
    t: Float64[np.ndarray, " n"],
) -> PathError:
    """The error in mm; the first run holds the values as they are."""
    size = size * 1e3
    worst = int(np.argmax(size[0]))
    ends, tops = size[:, -1], size.max(axis=1)

    def middle95(values: Vector) -> tuple[float, float]:
        low, high = (float(np.quantile(values, q)) for q in (0.025, 0.975))
        return min(low, float(values[0])), max(high, float(values[0]))

    return PathError(
        "mm", float(np.sqrt(np.mean(size[0] ** 2))), float(tops[0]), float(ends[0]),
        middle95(ends), middle95(tops), float(t[worst]), tuple(planned[worst].tolist()),
    )  # fmt: skip
