"""The report of an engineered twin: every choice, with the picture that explains it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from evertwin.engineering.engineer import Engineered
from evertwin.report.engineering_pictures import (
    draw_deviation,
    draw_map,
    draw_schedule,
    draw_sensitivity,
    draw_tree,
)
from evertwin.report.html import encoded, write_page


def write_engineering(done: Engineered, path: Path) -> None:
    """Writes the report, one file with its pictures inside.

    Raises:
        UsageError: the file cannot be written.
    """
    write_page("engineer.html", path, {
        "done": done, "study": done.study, "pictures": dict(_pictures(done)),
        "levels": {one.component: one for one in done.study.levels},
        "built": {one.component: one for one in done.plan.built},
    })  # fmt: skip


def _pictures(done: Engineered) -> Iterator[tuple[str, str]]:
    """(name, image) of what there is to draw."""
    study = done.study
    yield "tree", encoded(draw_tree(study))
    yield "map", encoded(draw_map(study))
    yield "sensitivity", encoded(draw_sensitivity(study))
    if study.weighed is not None and study.measured is not None:
        yield "schedule", encoded(draw_schedule(study.weighed, study.measured))
        limit = study.breakdown.requirements.accuracy
        yield "deviation", encoded(draw_deviation(study.measured, limit))
