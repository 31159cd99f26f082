"""An engineered twin, as a page and for the console: every choice, with its figures.

>>> print(table([("axis", "share"), ("tau1", "0.98")]))
axis  share
tau1  0.98
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader

from evertwin.engineering.engineer import Engineered
from evertwin.engineering.study import Study
from evertwin.report.html import write_page
from evertwin.tuning import Schedule


def write_engineering(done: Engineered, path: Path) -> None:
    """Writes the report, one file.

    Raises:
        UsageError: the file cannot be written.
    """
    study = done.study
    write_page("engineer.html", path, {
        "done": done, "study": study, "ranks": {one.component: one for one in study.ranks},
        "levels": {one.component: one for one in study.levels},
        "built": {one.component: one for one in done.plan.built},
        "signals": sorted({s.signal for link in study.links for s in link.signals}),
        "effects": {k.parameter: {s.signal: s.effect for s in k.signals} for k in study.links},
        "shade": _shade, "morris": _morris(study), "turns": _turns(study),
    })  # fmt: skip


def engineering_text(study: Study) -> str:
    """A study as text, step by step: what was chosen and why, one line a choice."""
    environment = Environment(
        loader=PackageLoader("evertwin.report", "templates"), trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"table": table, "nth": _nth}
    components = [("component", "score", "role", "level", "why")]
    for one, level in zip(study.ranks, study.levels, strict=True):
        role, depth = (f"{text}{'*' * bool(by)}" for text, by in (
            (one.role, one.overridden), (level.level, level.overridden)))  # fmt: skip
        components.append((one.component, f"{one.score:.1f}", role, depth, level.reason))
    choices = [(one.name, "tune" if one.editable else "keep", one.reason)
               for one in study.chosen.choices]  # fmt: skip
    return environment.get_template("engineer.txt").render(
        study=study, components=components, choices=[("parameter", "", "why"), *choices],
        overridden=any(r.overridden or v.overridden for r, v in zip(study.ranks, study.levels)),
    ).rstrip()  # fmt: skip


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of cells in columns; the last column runs free."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = ((cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
    return "\n".join("  ".join(cells).rstrip() for cells in padded)


def _nth(weight: float) -> str:
    turns = round(1.0 / weight)
    if turns == 1:
        return "single"
    teen = 10 <= turns % 100 <= 20
    return f"{turns}{'th' if teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(turns % 10, 'th')}"


def _shade(effect: float) -> float:
    """How dark an effect is shown: 0 at 0.01 % of the signal, 1 at all of it."""
    return min(max(0.25 * math.log10(1e4 * effect), 0.0), 1.0)


def _morris(study: Study) -> dict[str, tuple[float, float]]:
    """Largest effect on an output of each parameter, and its spread."""
    found = zip(study.morris.mu.max(axis=0), study.morris.spread.max(axis=0), strict=True)
    return dict(zip(study.morris.names, found, strict=True))


def _turns(study: Study) -> list[tuple[str, ...]]:
    """The parameters of each tuning by the schedule."""
    if study.weighed is None or study.measured is None:
        return []
    schedule = Schedule(study.weighed.weights)
    return [schedule.due(turn) for turn in range(study.measured.tunings)]
