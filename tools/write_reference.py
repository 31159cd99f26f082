"""Writes the reference pages that follow from the source: twin, breakdown, scenario and site file,
parts, model kinds.

    python -m tools.write_reference          # or: make reference

tests/test_reference.py compares them with the source.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from evertwin.ahead.spec import SCENARIO
from evertwin.config import TWIN
from evertwin.engineering.breakdown import BREAKDOWN
from evertwin.service.site.site_spec import SITE
from tools import components_page, models_page
from tools.settings_page import page

FOLDER = Path(__file__).parent.parent / "docs" / "reference"


PAGES: dict[str, Callable[[], str]] = {
    "twin-file.md": partial(page, TWIN),
    "breakdown-file.md": partial(page, BREAKDOWN),
    "scenario-file.md": partial(page, SCENARIO),
    "site-file.md": partial(page, SITE),
    "components.md": components_page.page,
    "models.md": models_page.page,
}
"""What writes each page."""


if __name__ == "__main__":
    for name, written in PAGES.items():
        (FOLDER / name).write_text(written(), encoding="utf-8")
        print(FOLDER.name, name)
