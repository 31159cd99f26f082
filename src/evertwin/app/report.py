"""The report: one self-contained HTML file. Pictures are inside, nothing is loaded."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape
from matplotlib.figure import Figure

from evertwin.errors import UsageError
from evertwin.fold import plain
from evertwin.models.form import Version
from evertwin.twin import RunResult
from evertwin.twin.draw import (
    draw_deviation,
    draw_intervals,
    draw_rounds,
    draw_run,
    draw_table,
)
from evertwin.twin.setup import Setup

__all__ = ["write_report"]

MOST = 8
"""Outputs that are drawn."""


def write_report(result: RunResult, setup: Setup, path: Path) -> None:
    """Writes the report of a run.

    Raises:
        UsageError: the file cannot be written.
    """
    environment = Environment(
        loader=PackageLoader("evertwin.app", "templates"), autoescape=select_autoescape()
    )
    content: Any = result.to_dict()
    page = environment.get_template("report.html").render(
        run=content,
        name=result.name,
        pictures=list(_pictures(result, setup, content)),
        promotions=[plain(e) for e in result.of_kind("promoted", "rolled_back", "rejected")],
        text=str(result),
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error


def _pictures(result: RunResult, setup: Setup, content: Any) -> Iterator[tuple[str, str, str]]:
    """(title, caption, image) of each picture."""
    names = result.model.outputs.names[:MOST]
    for name in names:
        caption = "Measured, predicted and residual with its 95 % band; changes of champion dashed."
        yield f"{name}: run", caption, _encoded(draw_run(result, name))
    if result.position_updates[0] or setup.spec.arbiter.use == "tolerance":
        name = names[0]
        for before in (True, False):
            title = "Position updates before" if before else "Position updates after"
            caption = "The last 100 measured samples; hatched where the tolerance was exceeded."
            yield title, caption, _encoded(draw_deviation(result, name, before))
    for version in result.versions:
        term = next((t for t in version.form.terms if t.kind == "table"), None)
        if term is None:
            continue
        unit = result.model.inputs.units[result.model.inputs.index(term.channel)]
        figure = draw_table(version, unit)
        if figure is not None:
            caption = f"What the machine does with a command ({version.reason})."
            yield f"Translation table of version {version.number}", caption, _encoded(figure)
    if setup.static:
        yield from _rounds(result)
    figure = draw_intervals(content["parameters"])
    if figure is not None:
        yield "Parameters", "Tuned values with their 95 % intervals.", _encoded(figure)


def _rounds(result: RunResult) -> Iterator[tuple[str, str, str]]:
    """Torque of the last task by every version, one picture for all axes."""
    trace = result.trace
    last = trace["task"] == trace["task"][-1]
    u = np.ascontiguousarray(trace["input"][last])
    t = (trace["t"][last] - trace["t"][last][0]) * 1e-9
    names = result.model.outputs.names
    rounds = [_predicted(result, version, u) for version in result.versions]
    figure = draw_rounds(trace["measured"][last], rounds, names, t)
    caption = "The last task, measured and as each version predicts it."
    yield "Every version on the last task", caption, _encoded(figure)


def _predicted(result: RunResult, version: Version, u: np.ndarray) -> np.ndarray:
    model = result.model_of(version)
    _, y = model.simulate(model.initial(version.p), u, np.zeros(len(u)), version.p)
    return y


def _encoded(figure: Figure) -> str:
    """The figure as a data address."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
