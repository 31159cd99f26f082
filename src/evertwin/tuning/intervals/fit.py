"""The Fit: the record of one tuning, with intervals, verdicts and what the residual still says.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.models import FunctionModel, Parameters
>>> from evertwin.signals import Layout
>>> from evertwin.tuning import Problem, solve
>>> spring = FunctionModel(lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(z="m"),
...     Layout.of(force="N"), parameters=Parameters.of(stiffness=(2.0, "N/m")))
>>> z = np.linspace(-1, 1, 50)[:, None]
>>> rows = make_block(t=np.arange(50), u=z, y=3 * z)
>>> fit = solve(Problem(spring, (rows,)))
>>> fit.names, fit.values.round(6).tolist(), fit.verdict
(('stiffness',), [3.0], ('identifiable',))
"""

from __future__ import annotations

import html
import math
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import few
from evertwin.fold import plain
from evertwin.signals.spoken import percent
from evertwin.tuning.residuals.statistics import Dependence
from evertwin.types import Float64, Json, ParameterVector, Vector

_SURE = {"identifiable": 0, "weak": 1, "not": 2}
"""Verdicts, in the order of a table."""
SHORT = 40
"""Characters of a reason that may stand in every row of a table."""


@dataclass(frozen=True)
class Residual:
    """The tuned residual of one output.

    >>> Residual("torque", 500, 0.2, 0.05, 0.7, None).white
    True
    """

    output: str
    rows: int
    """Rows that counted."""
    rms_before: float
    """In the output's unit."""
    rms_after: float
    whiteness: float
    """Probability that a white residual shows so much autocorrelation."""
    dependence: Dependence | None
    """The input that explains most of it."""

    @property
    def white(self) -> bool:
        """True where nothing speaks against a white residual (1 %)."""
        return self.whiteness > 0.01

    @property
    def independent(self) -> bool:
        """True where no input explains it (1 %)."""
        return self.dependence is None or self.dependence.p > 0.01


class Amend(NamedTuple):
    """What is found of one number behind its tuning.

    >>> Amend(word="weak", why=("differs among recordings",)).interval is None
    True
    """

    interval: tuple[float, float] | None = None
    """Its interval from now on; None: as it was."""
    word: str = ""
    """Its verdict from now on; empty: as it was."""
    why: tuple[str, ...] = ()
    """Said of it besides; what is empty is not."""


@dataclass(frozen=True, eq=False)
class Fit:
    """One tuning. See the module for an example."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Vector
    """Tuned values, (k,); the prior's where the verdict is *not*."""
    start: Vector
    sigma: Vector
    """Standard deviations, (k,); infinite where not identifiable."""
    interval95: Float64[np.ndarray, "k 2"]
    covariance: Float64[np.ndarray, "k k"]
    verdict: tuple[str, ...]
    """identifiable, weak or not."""
    reasons: tuple[str, ...]
    p: ParameterVector
    """The model's full parameter vector."""
    cost: float
    """Half the weighted sum of squares at the end."""
    outputs: tuple[str, ...]
    deviation_before: tuple[float, ...]
    """rms(residual) / rms(measured) per output at the start; NaN without rows."""
    deviation_after: tuple[float, ...]
    moving_before: tuple[float, ...]
    """The same over moving rows (all rows where the problem does not say)."""
    moving_after: tuple[float, ...]
    noise: Float64[np.ndarray, " ny"]
    """Standard deviation of each output's residual, (ny,)."""
    residuals: tuple[Residual, ...]
    condition: float
    at_bound: tuple[str, ...]
    """Parameters that ended on a bound."""
    iterations: int
    evaluations: int
    """Simulations of all rows."""
    method: str
    converged: bool
    message: str
    """One sentence; where not converged, with the cure."""
    seconds: float

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Names with the verdict *identifiable*."""
        pairs = zip(self.names, self.verdict, strict=True)
        return tuple(name for name, verdict in pairs if verdict == "identifiable")

    @property
    def moved(self) -> tuple[str, ...]:
        """What was tuned, in words: the identifiable ones, then what else moved and how sure."""
        rest = zip(self.names, self.verdict, self.values != self.start, strict=True)
        others = [name for name, word, on in rest if on and word != "identifiable"]
        return (*self.identifiable, *(f"{name} (weak)" for name in others))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of one parameter."""
        low, high = self.interval95[self.names.index(name)].tolist()
        return low, high

    def amended(self, found: Mapping[int, Amend]) -> Fit:
        """The fit with what was found of the numbers at these places. Values stay."""
        interval95, verdict, reasons = self.interval95.copy(), [*self.verdict], [*self.reasons]
        for k, (interval, word, why) in found.items():
            interval95[k] = interval95[k] if interval is None else interval
            verdict[k] = word or verdict[k]
            reasons[k] = "; ".join(filter(None, (reasons[k], *why)))
        return replace(self, interval95=interval95, verdict=tuple(verdict), reasons=tuple(reasons))

    def to_dict(self, *, timing: bool = True) -> dict[str, Json]:
        """Plain scalars for JSON, infinities as None. Without ``timing`` equal fits stay equal."""
        pairs = enumerate(self.names)
        content: dict[str, Any] = {
            "parameters": {
                name: {
                    "value": self.values[j], "start": self.start[j], "unit": self.units[j],
                    "sigma": self.sigma[j], "interval95": self.interval95[j],
                    "verdict": self.verdict[j], "reason": self.reasons[j],
                }
                for j, name in pairs
            },
            "outputs": {
                r.output: {
                    "deviation_before": self.deviation_before[k],
                    "deviation_after": self.deviation_after[k],
                    "moving_before": self.moving_before[k], "moving_after": self.moving_after[k],
                    "rms_before": r.rms_before, "rms_after": r.rms_after, "rows": r.rows,
                    "whiteness": r.whiteness,
                    "dependence": r.dependence and r.dependence._asdict(),
                }
                for k, r in enumerate(self.residuals)
            },
            "method": self.method, "converged": self.converged, "message": self.message,
            "iterations": self.iterations, "evaluations": self.evaluations,
            "condition": self.condition, "at_bound": self.at_bound, "cost": self.cost,
        }  # fmt: skip
        if timing:
            content["seconds"] = self.seconds
        return plain(content)  # type: ignore[return-value]

    def _table(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = []
        reasons, _ = self._told()
        for j, name in enumerate(self.names):
            low, high = self.interval95[j].tolist()
            half = (high - low) / 2
            shown = f"± {half:.3g}" if math.isfinite(half) else "unknown"
            if abs((low + high) / 2 - self.values[j]) > 0.05 * half:
                shown = f"{low:.4g} to {high:.4g}"  # not about the value
            value, unit = f"{self.values[j]:.5g}", self.units[j]
            rows.append((name, value, shown, unit, self.verdict[j], reasons[j]))
        return rows

    def _told(self) -> tuple[list[str], list[str]]:
        """Reasons per parameter, and what several of them share, which stands once: as "[1]"."""
        parts = [reason.split("; ") if reason else [] for reason in self.reasons]
        counts = Counter(part for one in parts for part in dict.fromkeys(one))
        shared = [part for part, count in counts.items() if count > 1 and len(part) > SHORT]
        marks = {part: f"[{n}]" for n, part in enumerate(shared, 1)}
        told = ["; ".join(marks.get(part, part) for part in dict.fromkeys(one)) for one in parts]
        return told, [f"{mark} {part}" for part, mark in marks.items()]

    def __repr__(self) -> str:
        told = zip(self.names, self.values, strict=True)
        return f"<Fit by {self.method}: {few(f'{name}={value:.6g}' for name, value in told)}>"

    def __str__(self) -> str:
        """A table of parameters, then of outputs."""
        return self.text()

    def text(self, later: Collection[str] = ()) -> str:
        """The same: what is told first, then what is weak, then what is not; of each those that
        come ``later``, as what the machine is built of, behind the others."""
        lines, wide = [f"{self.method}: {self.message}"], max([12, *map(len, self.names)])
        table = sorted(self._table(), key=lambda row: (_SURE.get(row[4], 1), row[0] in later))
        for name, value, half, unit, verdict, reason in table:
            tail = f"  {reason}" if reason else ""
            lines.append(f"  {name:<{wide}} {value:>10} {half:<12} {unit:<8} {verdict}{tail}")
        lines += [f"  {told}" for told in self._told()[1]]
        for name, before, after in zip(
            self.outputs, self.deviation_before, self.deviation_after, strict=True
        ):
            lines.append(f"  {name:<{wide}} {percent(before):>11} -> {percent(after)}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """The same tables for a notebook."""
        head = "<tr><th>parameter<th>value<th>95 %<th>unit<th>verdict<th>reason</tr>"
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}" for cell in row) + "</tr>"
            for row in self._table()
        )
        shared = "".join(f"<p>{html.escape(told)}</p>" for told in self._told()[1])
        rows = "".join(
            f"<tr><td>{html.escape(name)}<td>{percent(before)}<td>{percent(after)}</tr>"
            for name, before, after in zip(
                self.outputs, self.deviation_before, self.deviation_after, strict=True
            )
        )
        return (
            f"<p>{html.escape(self.method)}: {html.escape(self.message)}</p>"
            f"<table>{head}{body}</table>{shared}"
            f"<table><tr><th>output<th>deviation before<th>after</tr>{rows}</table>"
        )
