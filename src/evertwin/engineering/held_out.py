"""Validation: does the model describe the machine on runs that it was not tuned on?

Per output: the deviation over all rows and over moving rows, after the same filter on both sides,
against the requirement; whether what is left is white, and if not, which input it depends on. A
filter correlates neighbouring rows, so whiteness is judged on rows as far apart as the filter lets
them be.

>>> rng = np.random.default_rng(0)
>>> y, r = np.sin(np.arange(500.0))[:, None], 0.01 * rng.normal(size=(500, 1))
>>> run = Run("monday.csv", y, r, np.ones((500, 1), bool), np.zeros((500, 1)))
>>> rules = Rules(("q",), ("rad",), ("u",), requirement=0.05)
>>> report = validate("arm", (run,), rules)
>>> report.passed, report.together[0].relative_rms < 0.02, report.together[0].white
(True, True, True)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evertwin.fold import plain
from evertwin.signals.sizes import rms_of, size
from evertwin.tuning.residuals.statistics import autocorrelation, dependences, ljung_box
from evertwin.types import Inputs, Json, Outputs, Vector

WHITE = 0.01
"""Probability below which a residual is not white, or depends on an input."""
FEWEST = 30
"""Rows that it takes to say anything about what is left."""
SHARE = 0.1
"""Least share of the residual's variance that an input must explain to be named."""


@dataclass(frozen=True, eq=False)
class Run:
    """One recording, predicted.

    >>> Run("a.csv", np.zeros((2, 1)), np.zeros((2, 1)), np.ones((2, 1), bool), np.zeros((2, 1))).n
    2
    """

    name: str
    measured: Outputs
    residual: Outputs
    """measured − predicted, filtered as the measurement was; NaN where either is unknown."""
    moving: np.ndarray
    """Which rows count as moving, (n, ny)."""
    u: Inputs

    @property
    def n(self) -> int:
        """Rows."""
        return len(self.measured)


@dataclass(frozen=True)
class Rules:
    """What the outputs are held to.

    >>> Rules(("x",), ("m",), ("v",)).watched
    ('x',)
    """

    outputs: tuple[str, ...]
    units: tuple[str, ...]
    inputs: tuple[str, ...]
    requirement: float = math.inf
    """Largest deviation; infinite: none is set."""
    relative: bool = True
    """Is it relative to the measurement's rms, or in the output's unit?"""
    held: tuple[str, ...] = ()
    """Outputs that are held to it; empty: all."""
    left_out: tuple[str, ...] = ()
    """Outputs that are not compared (starts of a prediction)."""
    moving: bool = False
    """Is the requirement about moving rows?"""
    filter: Mapping[str, Json] | None = None
    every: int = 1
    """Rows between two that the filter leaves independent."""

    @property
    def watched(self) -> tuple[str, ...]:
        """Outputs that are held to the requirement."""
        return self.held or self.outputs


@dataclass(frozen=True)
class OutputReport:
    """Figures of one output.

    >>> OutputReport("tau1", "Nm", 400, 300, 0.5, 0.06, 0.04, 0.05, True).passed
    True
    """

    name: str
    unit: str
    rows: int
    moving: int
    """Moving rows."""
    rms: float
    relative_rms: float
    relative_rms_moving: float
    limit: float = math.inf
    passed: bool | None = None
    """Is the deviation within the limit? None: nothing is asked of it."""
    white: bool = True
    probability: float = 1.0
    """Of so much autocorrelation by chance (Ljung-Box)."""
    correlation: float = 0.0
    """Autocorrelation of neighbouring rows that are counted."""
    input: str = ""
    """Input that explains most of what is left; empty where none does."""
    share: float = 0.0
    """Share of the variance that it explains."""

    def __str__(self) -> str:
        word = {True: "ok     ", False: "MISSED ", None: "       "}[self.passed]
        left = "white" if self.white else f"not white (ρ₁ {self.correlation:.2f})"
        if self.input:
            left += f", {100 * self.share:.0f} % with {self.input}"
        return (
            f"{word} {self.name:<10} rms {self.rms:.4g} {self.unit}  {_percent(self.relative_rms)}"
            f"  moving {_percent(self.relative_rms_moving)} ({self.moving} of {self.rows})  {left}"
        )


def _percent(share: float) -> str:
    return f"{100 * share:6.2f} %"


@dataclass(frozen=True)
class ValidationReport:
    """All outputs over all runs together, and over each.

    >>> ValidationReport("arm", Rules((), (), ())).passed is None
    True
    """

    name: str
    rules: Rules
    together: tuple[OutputReport, ...] = ()
    runs: tuple[tuple[str, tuple[OutputReport, ...]], ...] = ()
    notes: tuple[str, ...] = field(default=())
    """What a reader must know about these figures."""

    @property
    def passed(self) -> bool | None:
        """Is every watched output within the requirement? None: no requirement, or no run."""
        said = [output.passed for output in self.together if output.passed is not None]
        return all(said) if said else None

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.validation/1"``."""
        return plain(  # type: ignore[return-value]
            {
                "schema": "evertwin.validation/1",
                "name": self.name,
                "passed": self.passed,
                "requirement": {
                    "value": self.rules.requirement, "relative": self.rules.relative,
                    "moving": self.rules.moving, "outputs": self.rules.watched,
                },
                "filter": self.rules.filter,
                "outputs": {o.name: o for o in self.together},
                "runs": [
                    {"file": name, "outputs": {o.name: o for o in found}}
                    for name, found in self.runs
                ],
                "notes": self.notes,
            }
        )  # fmt: skip

    def __str__(self) -> str:
        if not self.together:
            return f"{self.name}: validation: no run was given: name recordings that are held out"
        verdict = {True: "within", False: "beyond", None: "without"}[self.passed]
        many = f"{len(self.runs)} held-out run{'s' * (len(self.runs) != 1)}"
        head = f"{self.name}: validation on {many}: {verdict} a requirement"
        lines = [head if self.passed is None else f"{head} of {self._asked()}"]
        filtered = self.rules.filter
        if filtered:
            lines.append(f"  both sides filtered: {filtered['kind']}, {filtered['cutoff']} Hz")
        lines += [f"  {output}" for output in self.together]
        if len(self.runs) > 1:
            for name, found in self.runs:
                lines += [f"  {name}:", *(f"    {output}" for output in found)]
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    def _asked(self) -> str:
        rules = self.rules
        units = {u for n, u in zip(rules.outputs, rules.units, strict=True) if n in rules.watched}
        unit = units.pop() if len(units) == 1 else "SI"
        value = f"{rules.requirement:g} {unit}"
        if rules.relative:
            value = f"{100 * rules.requirement:g} %"
        return f"{value}{', moving rows' if rules.moving else ''}"


def validate(
    name: str, runs: Sequence[Run], rules: Rules, notes: Sequence[str] = ()
) -> ValidationReport:
    """The report of predicted runs.

    Args:
        name: of the twin.
        runs: recordings that the model was not tuned on.
        rules: what the outputs are held to.
        notes: what a reader must know.
    """
    if not runs:
        return ValidationReport(name, rules, notes=tuple(notes))
    each = tuple((run.name, _outputs((run,), rules)) for run in runs)
    return ValidationReport(name, rules, _outputs(runs, rules), each, tuple(notes))


def _outputs(runs: Sequence[Run], rules: Rules) -> tuple[OutputReport, ...]:
    residual = np.concatenate([run.residual for run in runs])
    measured = np.concatenate([run.measured for run in runs])
    moving = np.concatenate([run.moving for run in runs])
    left = _left(runs, rules)
    return tuple(
        _output(k, rules, (residual[:, k], measured[:, k], moving[:, k]), left.get(name, {}))
        for k, name in enumerate(rules.outputs)
        if name not in rules.left_out
    )


def _output(
    k: int, rules: Rules, columns: tuple[Vector, Vector, np.ndarray], left: Mapping[str, Any]
) -> OutputReport:
    residual, measured, moving = columns
    known = ~np.isnan(residual)
    moves = known & moving
    rms = rms_of(residual[known])
    whole, moved = (
        rms_of(residual[on]) / size(measured[on], rules.units[k] == "K") for on in (known, moves)
    )
    asked = math.isfinite(rules.requirement) and rules.outputs[k] in rules.watched
    judged = (moved if rules.moving else whole) if rules.relative else rms
    return OutputReport(
        rules.outputs[k], rules.units[k], int(known.sum()), int(moves.sum()), rms, whole, moved,
        rules.requirement if asked else math.inf,
        bool(judged <= rules.requirement) if asked else None, **left,
    )  # fmt: skip


def _left(runs: Sequence[Run], rules: Rules) -> dict[str, dict[str, Any]]:
    """Per output: whiteness and dependence of the residual, over the longest run."""
    run = max(runs, key=lambda r: r.n)
    thin = slice(None, None, max(1, rules.every))
    r, u = run.residual[thin], run.u[thin]
    known = np.isfinite(u).all(axis=1)
    if np.count_nonzero(known) < FEWEST:
        return {}
    named = {d.output: d for d in dependences(r[known], u[known], rules.outputs, rules.inputs)}
    out = {}
    for k, name in enumerate(rules.outputs):
        seen = r[:, k]
        if np.count_nonzero(~np.isnan(seen)) < FEWEST:
            continue
        p, rho = ljung_box(seen), autocorrelation(seen, 1)
        found = named.get(name)
        tells = found is not None and found.p < WHITE and found.share > SHARE
        out[name] = {
            "white": bool(p > WHITE), "probability": float(p), "correlation": float(rho[1]),
            "input": found.input if found and tells else "",
            "share": float(found.share) if found and tells else 0.0,
        }  # fmt: skip
    return out
