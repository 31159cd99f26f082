"""Fitting on recordings and judging on others: what ``evertwin fit`` does.

Nothing goes live here. Where the model has a ladder of friction laws, a rung is climbed, output by
output, only while the error on held-out tasks falls.
"""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evertwin.fold import Block, plain
from evertwin.models import Parameters
from evertwin.tuning import Fit, Problem
from evertwin.twin.evaluate import Deviation, deviations, predict
from evertwin.twin.feed import Data, Feed
from evertwin.twin.law import climb_laws
from evertwin.twin.setup import Setup
from evertwin.twin.versions import Versions
from evertwin.twin.work import Work
from evertwin.types import Json

__all__ = ["FitResult", "fit"]


@dataclass(frozen=True)
class FitResult:
    """The outcome of `Twin.fit`.

    >>> FitResult.__name__
    'FitResult'
    """

    name: str
    fit: Fit
    train: tuple[Deviation, ...]
    test: tuple[Deviation, ...]
    """Over all tests together; empty without tests."""
    tests: tuple[tuple[str, tuple[Deviation, ...]], ...]
    """Each test alone."""
    laws: Mapping[str, str]
    """Output → friction law that was chosen."""
    filter: Mapping[str, Json] | None
    parameters: Parameters

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.fit/1"``."""
        whole: Any = self.fit.to_dict()
        tested = {d.name: d for d in self.test}
        outputs = {}
        for d in self.train:
            there = tested.get(d.name)
            outputs[d.name] = {
                "unit": d.unit, "rms_train": d.rms, "relative_rms_train": d.relative_rms,
                "relative_rms_train_moving": d.relative_rms_moving,
                "rms_test": there and there.rms,
                "relative_rms_test": there and there.relative_rms,
                "relative_rms_test_moving": there and there.relative_rms_moving,
                "moving": there.moving if there else d.moving,
            }  # fmt: skip
        return plain(  # type: ignore[return-value]
            {
                "schema": "evertwin.fit/1",
                "name": self.name,
                "parameters": whole["parameters"],
                "outputs": outputs,
                "tests": [
                    {"file": file, "outputs": {d.name: d.to_dict() for d in found}}
                    for file, found in self.tests
                ],
                "filter": self.filter,
                "friction_law": self.laws,
                "converged": self.fit.converged,
                "message": self.fit.message,
                "method": self.fit.method,
                "iterations": self.fit.iterations,
                "evaluations": self.fit.evaluations,
                "seconds": self.fit.seconds,
            }
        )

    def __str__(self) -> str:
        """Parameters, then deviations per recording."""
        lines = [str(self.fit)]
        shown = (("train", self.train), *self.tests)
        for file, found in (*shown, ("all tests", self.test)) if self.test else shown:
            lines.append(f"{file}:")
            lines += [
                f"  {d.name:<10} {100 * d.relative_rms:7.2f} %   moving "
                f"{100 * d.relative_rms_moving:7.2f} % of {d.moving} rows"
                for d in found
            ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"{self.fit._repr_html_()}<pre>{html.escape(str(self))}</pre>"


def fit(
    setup: Setup, versions: Versions, number: int, train: Data, test: tuple[Any, ...]
) -> FitResult:
    """Tunes version ``number`` on ``train`` and judges it on each of ``test``."""
    feed, work = Feed(setup.spec, setup.model), Work(setup, versions)
    windows = tuple(feed.blocks(train))
    version = versions[number]
    problem: Problem = work.problem(version, windows, work.editable(version))
    problem, laws = climb_laws(setup, problem)
    found, _ = work.tune(problem)
    model = problem.model

    def judged(blocks: tuple[Block, ...]) -> tuple[Deviation, ...]:
        return deviations(setup, [predict(setup, model, found.p, block) for block in blocks])

    named = [(_named(item), tuple(feed.blocks(_listed(item)))) for item in test]
    together = tuple(block for _, blocks in named for block in blocks)
    rule = setup.spec.filter
    return FitResult(
        setup.spec.name, found, judged(windows), judged(together) if named else (),
        tuple((name, judged(blocks)) for name, blocks in named), laws,
        None if rule is None else {"kind": rule.kind, "order": rule.order, "cutoff": rule.cutoff},
        model.parameters.with_values(found.p),
    )  # fmt: skip


def _named(item: Any) -> str:
    return item if isinstance(item, str) else getattr(item, "name", "") or "rows"


def _listed(item: Any) -> Any:
    """One file is a list of one; blocks and columns are taken as they are."""
    if isinstance(item, Block):
        return (item,)
    return [item] if isinstance(item, str) or hasattr(item, "exists") else item
