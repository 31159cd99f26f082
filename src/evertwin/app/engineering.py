"""What ``evertwin engineer`` does, and its report."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, select_autoescape
from matplotlib.figure import Figure

from evertwin.app.console import show
from evertwin.app.engineering_draw import (
    draw_deviation,
    draw_map,
    draw_schedule,
    draw_sensitivity,
    draw_tree,
)
from evertwin.engineering.summary import summary
from evertwin.errors import DataError, UsageError
from evertwin.twin.engineer import Engineered, engineer
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
    environment = Environment(
        loader=PackageLoader("evertwin.app", "templates"), autoescape=select_autoescape()
    )
    page = environment.get_template("engineer.html").render(
        done=done, study=done.study, pictures=dict(_pictures(done)),
        levels={one.component: one for one in done.study.levels},
        built={one.component: one for one in done.plan.built},
    )  # fmt: skip
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error


def _pictures(done: Engineered) -> Iterator[tuple[str, str]]:
    """(name, image) of what there is to draw."""
    study = done.study
    yield "tree", _encoded(draw_tree(study))
    yield "map", _encoded(draw_map(study))
    yield "sensitivity", _encoded(draw_sensitivity(study))
    if study.weighed is not None and study.measured is not None:
        yield "schedule", _encoded(draw_schedule(study.weighed, study.measured))
        limit = study.breakdown.requirements.accuracy
        yield "deviation", _encoded(draw_deviation(study.measured, limit))


def _encoded(figure: Figure) -> str:
    """The figure as a data address; small figures stay sharp, tall ones small."""
    buffer = io.BytesIO()
    tall = float(figure.get_figheight())
    figure.savefig(buffer, format="png", dpi=min(130.0, 130.0 * math.sqrt(9.0 / max(tall, 9.0))))
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
