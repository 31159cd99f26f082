"""Verification and validation of a twin: what ``evertwin validate`` does.

The live version, or one that is tuned on other recordings first, is verified (are its equations
solved right?) and validated on recordings that it was not tuned on. Nothing goes live.

Verification of any model: what can be checked is, and what cannot is said.

Every model: the laws of its contract; with a state, half the step and rest. Machines of ours
besides: the arm against MuJoCo and by energy and momentum (`verify_arm`), the drive and the heated
box by their closed forms and by what heat and friction may do, the mobile bases by a closed circle.

>>> from evertwin.machines.mobile import Robot1D
>>> report = verify(Robot1D(), np.ones((20, 1)), np.full(20, 0.1))
>>> report.passed, [check.kind for check in report.not_run]
(True, ['engine'])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.engineering.held_out import Rules, Run, ValidationReport, validate
from evertwin.engineering.verification import Check, VerificationReport
from evertwin.engineering.verify_arm import resists, verify_arm
from evertwin.engineering.verify_machines import closed_forms
from evertwin.errors import LawBroken
from evertwin.fold import Block, plain
from evertwin.ledger.versions import Versions
from evertwin.machines.arm import Arm
from evertwin.machines.assembly.inverse import StaticInverse
from evertwin.machines.friction.resisting import WITHIN, within
from evertwin.models import Model, check_model
from evertwin.models.configured import configured
from evertwin.refit.recordings.fitting import Tuned, listed, named, tune
from evertwin.refit.recordings.screening import screened
from evertwin.refit.recordings.term_search import own_start
from evertwin.rows.feed import Data, Feed
from evertwin.setup.evaluation import Prediction, predict
from evertwin.setup.setup import Setup
from evertwin.setup.windows import starts
from evertwin.tuning.posing.hidden_starts import begun
from evertwin.types import Inputs, Intervals, Json, Outputs, ParameterVector, StateVector

ROWS = 200
"""Rows that are looked at."""
STEP = 0.01
"""How much of an output's size half the step may change."""
REST = 1e-6
"""How much of an output's size may still change at rest."""


def verify(
    model: Model,
    u: Inputs,
    dt: Intervals,
    p: ParameterVector | None = None,
    x: StateVector | None = None,
    name: str = "",
) -> VerificationReport:
    """All checks of a model.

    Args:
        model: what runs.
        u: rows that it is looked at on, (n, nu); a recording's are best.
        dt: their intervals [s].
        p: parameters; the model's own by default.
        x: state before the first row; the model's own by default.
        name: for the report.
    """
    values = model.parameters.values if p is None else np.array(p)
    start = model.initial(values) if x is None else x
    known = np.isfinite(u).all(axis=1)
    rows, steps = np.ascontiguousarray(u[known][:ROWS]), np.ascontiguousarray(dt[known][:ROWS])
    checks = [_contract(model, rows, steps, values)]
    if isinstance(model, Arm):
        checks += verify_arm(model, u, values)
    else:
        kind = type(model).__name__
        checks.append(
            Check.missing(
                "independent engine", "engine", f"there is no other engine for a {kind} here"
            )
        )
        checks += closed_forms(model, values)
        checks += [resists(model, u[known], values)] if isinstance(model, StaticInverse) else []
    if len(model.states):
        checks += [_halved(model, start, rows, steps, values), _rest(model, start, steps, values)]
    else:
        checks.append(Check.missing("half the step", "numerics", "a static map has no steps"))
    return VerificationReport(name or type(model).__name__, tuple(checks))


def _contract(model: Model, u: Inputs, dt: Intervals, p: ParameterVector) -> Check:
    """The laws of a Model, on these rows and at these parameters."""
    name, said = "laws of the contract", f"{len(u)} rows"
    try:
        tuned = model.parameters.with_values(p)
        check_model(configured(model, parameters=tuned), u, dt)
    except LawBroken as error:
        return Check(name, "contract", 1.0, 0.0, "1", str(error))
    return Check(name, "contract", 0.0, 0.0, "1", said)


def _halved(model: Model, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Check:
    """Each row as two of half its duration: a solver that is fine enough gives the same."""
    _, whole = model.simulate(x, u, dt, p)
    twice = np.repeat(u, 2, axis=0), np.repeat(0.5 * dt, 2)
    _, half = model.simulate(x, *twice, p)
    off, worst = _off(whole, half[1::2])
    said = f"{len(u)} rows; of the range of {model.outputs.names[worst]}"
    return Check("half the step", "numerics", off, STEP, "1", said)


def _off(a: Outputs, b: Outputs) -> tuple[float, int]:
    """Largest difference of an output relative to its range, and of which one."""
    with np.errstate(invalid="ignore"):
        reach = np.ptp(a, axis=0)
        change = np.abs(a - b).max(axis=0)
    shares = np.where(change == 0.0, 0.0, change / np.where(reach > 0.0, reach, np.nan))
    shares = np.where(np.isnan(shares), np.inf, shares)
    worst = int(np.argmax(shares))
    return float(shares[worst]), worst


def _rest(model: Model, x: StateVector, dt: Intervals, p: ParameterVector) -> Check:
    """Inputs held at zero, or as near as is possible: the outputs come to rest or stay bounded."""
    low = np.array([c.low for c in model.inputs])
    high = np.array([c.high for c in model.inputs])
    still = np.clip(0.0, low, high)
    step = float(np.median(dt[dt > 0])) if (dt > 0).any() else 0.01
    rows = 4000
    _, y = model.simulate(x, np.tile(still, (rows, 1)), np.full(rows, step), p)
    parts: Any = [y[: rows // 2], y[rows // 2 :]]
    if not np.isfinite(y).all():
        return Check("rest", "law", np.inf, REST, "1", "the outputs run away with inputs at zero")
    early, late = (np.ptp(part, axis=0) for part in parts)
    size = np.maximum(np.abs(y).max(axis=0), 1e-12)
    # An output that only settles slowly has to settle; one that keeps a constant swing stays so.
    share = float((np.maximum(0.0, late - early) / size).max())
    said = f"{rows * step:.3g} s with inputs at zero: no growing motion"
    return Check("rest", "law", share, REST, "1", said)


@dataclass(frozen=True)
class Validation:
    """Both reports.

    >>> Validation.__name__
    'Validation'
    """

    verification: VerificationReport
    validation: ValidationReport
    runs: tuple[Run, ...] = field(default=(), repr=False)
    """What was predicted, for pictures."""

    @property
    def passed(self) -> bool:
        """Did every check pass that ran, and is no watched output beyond its requirement?"""
        return self.verification.passed and self.validation.passed is not False

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.validate/1"``."""
        both = {
            "verification": self.verification.to_dict(),
            "validation": self.validation.to_dict(),
        }
        head = {"schema": "evertwin.validate/1", "name": self.validation.name}
        return plain({**head, "passed": self.passed, **both})  # type: ignore[return-value]

    def __str__(self) -> str:
        return f"{self.verification}\n{self.validation}"


def validated(
    setup: Setup, versions: Versions, number: int, test: Sequence[Any], train: Data = None
) -> Validation:
    """Verifies and validates version ``number``.

    Args:
        setup: of the twin.
        versions: all versions.
        number: of the version.
        test: recordings that it was not tuned on; none: those that the twin file names.
        train: recordings that it is tuned on first; None: it is taken as it is.
    """
    notes: list[str] = []
    tuned = None if train is None else tune(setup, versions, number, train)
    if tuned is None:
        notes.append(f"version {number} as it is; with --train it is tuned first")
        if setup.spec.tuning.method == "recursive":
            notes.append("parameters that are followed in the stream stand still here")
    if not test and not any(source.files for source in setup.spec.source):
        return _report(setup, versions, number, (tuned, [], notes))
    if not test:
        notes.append("on the twin file's recordings: whether it was tuned on them is not known")
    items = list(test) or [None]
    runs = [(named(item) if test else "twin file", _seen(setup, versions, number, (tuned, item)))
            for item in items]  # fmt: skip
    return _report(setup, versions, number, (tuned, runs, notes))


def _seen(
    setup: Setup, versions: Versions, number: int, what: tuple[Tuned | None, Any]
) -> list[Prediction]:
    """The predictions of one recording's tasks."""
    tuned, item = what
    data = None if item is None else listed(item)
    if tuned is not None:
        return tuned.judged(tuned.rows(data).rows).predictions
    model, p = versions.model(number), versions[number].p
    blocks = screened(setup, model, p, Feed(setup.spec, setup.model).blocks(data)).rows
    found = [(block, own_start(setup, model, p, block)) for block in starts(setup, blocks)]
    return [
        predict(setup, model, own.p, block, start=begun(model, own.p, own.fitted, 0)[0])
        for block, own in found
    ]


def _report(
    setup: Setup,
    versions: Versions,
    number: int,
    found: tuple[Tuned | None, list[tuple[str, list[Prediction]]], list[str]],
) -> Validation:
    tuned, runs, notes = found
    model = versions.model(number) if tuned is None else tuned.model
    p = versions[number].p if tuned is None else tuned.formed.fit.p
    inner, values = _inner(model, p)
    if inner is not model:
        notes.append("verified without its learned terms: they have no law but the data")
    notes += getattr(inner, "notes", ())
    u, dt = _rows(inner, [prediction for _, one in runs for prediction in one])
    blocks = [prediction.window for _, one in runs for prediction in one]
    x = inner.initial(values)
    if blocks and len(x):
        x = inner.observe(x, blocks[0].y[0])
    verification = verify(inner, u, dt, values, x, setup.spec.name)
    each = tuple(_run(name, one) for name, one in runs if one)
    return Validation(verification, validate(setup.spec.name, each, _rules(setup), notes), each)


def _inner(model: Model, p: ParameterVector) -> tuple[Model, ParameterVector]:
    """The machine's own model inside wrappers, and its parameters."""
    inner: Any = model
    while not hasattr(inner, "chain") and isinstance(getattr(inner, "model", None), Model):
        inner = inner.model
    return inner, p[model.parameters.indices(inner.parameters.names)]


def _rows(model: Model, seen: list[Prediction]) -> tuple[Inputs, Intervals]:
    """Rows to verify on: the first task that was predicted, else random ones within limits."""
    if seen:
        block: Block = seen[0].window
        return block.u, block.dt
    return within(model.inputs), np.full(WITHIN, 0.01)


def _run(name: str, seen: list[Prediction]) -> Run:
    columns = ((s.measured, s.residual, s.moving, s.window.u) for s in seen)
    return Run(name, *map(np.concatenate, zip(*columns, strict=True)))


def _rules(setup: Setup) -> Rules:
    spec, outputs = setup.spec, setup.model.outputs
    watched = tuple(n for n, on in zip(outputs.names, setup.watched.tolist(), strict=True) if on)
    silent = tuple(n for n in outputs.names if n in spec.signals and not spec.signals[n].judge)
    rule, every, kept = spec.filter, 1, None
    if rule is not None:
        every = max(1, round((spec.clock.rate or 0.0) / (2.0 * rule.cutoff)))
        kept = {"kind": rule.kind, "order": rule.order, "cutoff": rule.cutoff}
    return Rules(
        outputs.names, outputs.units, setup.model.inputs.names, setup.requirement, setup.relative,
        tuple(n for n in watched if n not in silent), silent, spec.moving is not None, kept, every,
    )  # fmt: skip
