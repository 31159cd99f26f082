"""The report of a validation: deviations against the requirement, and what is left."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from evertwin.engineering.validation import Validation
from evertwin.report.html import encoded, write_page
from evertwin.tuning.statistics import autocorrelation

MOST = 8
"""Outputs that are drawn."""


def write_validation(found: Validation, path: Path) -> None:
    """Writes the report, one file with its pictures inside.

    Raises:
        UsageError: the file cannot be written.
    """
    write_page("validation.html", path, {"found": found, "pictures": _pictures(found)})


def _pictures(found: Validation) -> list[tuple[str, str]]:
    """(caption, image) of what there is to draw."""
    if not found.runs:
        return []
    return [
        ("Deviation per output, all rows and moving rows, against the requirement.", _bars(found)),
        ("What is left over the longest run, and its autocorrelation.", _left(found)),
    ]


def _bars(found: Validation) -> str:
    outputs = found.validation.together[:MOST]
    rules = found.validation.rules
    figure = Figure(figsize=(9, 2.6), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(outputs))
    for shift, label, values in (
        (-0.2, "all rows", [o.relative_rms for o in outputs]),
        (0.2, "moving rows", [o.relative_rms_moving for o in outputs]),
    ):
        axes.bar(places + shift, 100 * np.nan_to_num(values), 0.38, label=label)
    if rules.relative and np.isfinite(rules.requirement):
        axes.axhline(100 * rules.requirement, color="0.2", linestyle="--", label="requirement")
    axes.set_xticks(places, [o.name for o in outputs])
    axes.set_ylabel("rms, % of measured")
    axes.set_ylim(top=1.35 * axes.get_ylim()[1])
    axes.legend(frameon=False, fontsize=8, ncols=3, loc="upper right")
    return encoded(figure)


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
    return encoded(figure)
