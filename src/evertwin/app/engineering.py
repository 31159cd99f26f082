"""What ``evertwin engineer`` does, and its report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from evertwin.app.console import show
from evertwin.app.engineering_draw import (
    draw_deviation,
    draw_map,
    draw_schedule,
    draw_sensitivity,
    draw_tree,
)
from evertwin.app.page import encoded, write_page
from evertwin.engineering.summary import summary
from evertwin.errors import DataError, UsageError
from evertwin.twin.engineering.engineer import Engineered, engineer
from evertwin.twin.parts import Part

__all__ = ["engineer_twin", "write_engineering"]


def engineer_twin(
    breakdown: Path,
    out: tuple[Path, Path | None, bool],
    data: Sequence[Path] | None,
    as_json: bool,
) -> None:
    """``evertwin engineer``; ``out``: twin file, report, and whether files may be overwritten.

    Raises:
        UsageError: the twin file is there already.
        DataError: a recording is not there.
    """
    twin, report, force = out
    if twin.exists() and not force:
        raise UsageError(f"{twin}: exists already: choose another name, or say --force")
    for path in data or ():
        if not Part.parse(path).path.exists():
            raise DataError(f"{Part.parse(path).path}: no such file")
    done = engineer(breakdown, twin, None if not data else [str(path) for path in data])
    if report is not None:
        write_engineering(done, report)
    content = done.study.to_dict() | {"file": str(done.path)}
    text = f"{summary(done.study)}\n\n{done.path}: written; next: evertwin run {done.path}"
    show(content, text, as_json)


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
