"""The report of lives and plan: one self-contained HTML file, pictures inside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from evertwin.app.report import encoded, shown
from evertwin.errors import UsageError
from evertwin.prognosis.planning import Plan
from evertwin.twin.ahead.draw import draw_indicator, draw_plan
from evertwin.twin.ahead.lives import Lives

__all__ = ["write_prognosis"]


def write_prognosis(lives: Lives, plan: Plan | None, path: Path) -> None:
    """Writes the report.

    Raises:
        UsageError: the file cannot be written.
    """
    environment = Environment(
        loader=PackageLoader("evertwin.app", "templates"), autoescape=select_autoescape()
    )
    environment.filters["shown"] = shown
    content: Any = lives.to_dict()
    pictures = [
        (f"{one.component}: {one.indicator.name}", one.sentence, encoded(draw_indicator(one)))
        for one in lives.indicators
    ]
    timeline = None if plan is None or not plan.items else encoded(draw_plan(plan, lives))
    page = environment.get_template("prognosis.html").render(
        name=lives.name, life=content, lives=lives, pictures=pictures, plan=plan, timeline=timeline
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
