"""The report of a validation: deviations against the requirement, and what is left."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from evertwin.engineering.validation import Validation
from evertwin.report.charts import inline
from evertwin.report.html import write_page
from evertwin.tuning.residuals.statistics import autocorrelation

MOST = 8
"""Outputs that are drawn."""


def write_validation(found: Validation, path: Path) -> None:
    """Writes the report, one file with its pictures inside.

    Raises:
        UsageError: the file cannot be written.
    """
    picture = _left(found) if found.runs else None
    write_page("validation.html", path, {"found": found, "picture": picture})


def _left(found: Validation) -> str:
    run = max(found.runs, key=lambda r: r.n)
    rules = found.validation.rules
    shown = [k for k, name in enumerate(rules.outputs) if name not in rules.left_out][:MOST]
    figure = Figure(figsize=(9, 1.3 * len(shown)), layout="constrained")
    grid: Any = figure.subplots(len(shown), 2, squeeze=False, width_ratios=(3, 1), sharex="col")
    for (left, right), k in zip(grid, shown, strict=True):
        left.plot(run.residual[:, k], linewidth=0.6)
        left.set_ylabel(f"{rules.outputs[k]}\n[{rules.units[k]}]", fontsize=8)
        rho = autocorrelation(run.residual[:: rules.every, k], 20)
        right.stem(np.arange(len(rho)), rho, basefmt=" ")
        right.set_ylim(-1.05, 1.05)
    grid[-1][0].set_xlabel(f"row of {run.name}", fontsize=8)
    grid[-1][1].set_xlabel("lag" if rules.every == 1 else f"lag, {rules.every} rows", fontsize=8)
    return inline(figure, "what is left over the longest run, and its autocorrelation")
