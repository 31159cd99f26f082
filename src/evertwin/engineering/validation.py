"""Verification and validation of a twin: what ``evertwin validate`` does.

The live version, or one that is tuned on other recordings first, is verified (are its equations
solved right?) and validated on recordings that it was not tuned on. Nothing goes live.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.engineering.held_out import Rules, Run, ValidationReport, validate
from evertwin.engineering.verification import VerificationReport
from evertwin.engineering.verify import verify
from evertwin.fold import Block, plain
from evertwin.loop.evaluation import Prediction, predict
from evertwin.loop.feed import Data, Feed
from evertwin.loop.fitting import Tuned, listed, named, tune
from evertwin.loop.screening import screened
from evertwin.loop.setup import Setup
from evertwin.loop.term_search import own_start
from evertwin.loop.versions import Versions
from evertwin.loop.windows import starts
from evertwin.machines.friction.resisting import WITHIN, within
from evertwin.models import Model
from evertwin.types import Inputs, Intervals, Json, ParameterVector


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
        return plain(  # type: ignore[return-value]
            {
                "schema": "evertwin.validate/1",
                "name": self.validation.name,
                "passed": self.passed,
                "verification": self.verification.to_dict(),
                "validation": self.validation.to_dict(),
            }
        )

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
        return tuned.judged(tuned.rows(data)).predictions
    model, p = versions.model(number), versions[number].p
    blocks = screened(setup, model, p, Feed(setup.spec, setup.model).blocks(data))
    return [
        predict(setup, model, own_start(setup, model, p, block), block)
        for block in starts(setup, blocks)
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
    return Run(
        name,
        np.concatenate([s.measured for s in seen]),
        np.concatenate([s.residual for s in seen]),
        np.concatenate([s.moving for s in seen]),
        np.concatenate([s.window.u for s in seen]),
    )


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
