"""Writes the reference pages that follow from the source: twin, breakdown, scenario and site file,
parts, model kinds.

    python -m tools.write_reference          # or: make reference

tests/test_reference.py compares them with the source.
"""

from __future__ import annotations

from pathlib import Path

from evertwin.ahead.spec import SCENARIO
from evertwin.config import TWIN
from evertwin.engineering.breakdown import BREAKDOWN
from evertwin.service.site import SITE
from tools import components_page, models_page
from tools.settings_page import page

FOLDER = Path(__file__).parent.parent / "docs" / "reference"


def pages() -> dict[str, str]:
    """Name of each page and its text."""
    return {
        "twin-file.md": page(TWIN),
        "breakdown-file.md": page(BREAKDOWN),
        "scenario-file.md": page(SCENARIO),
        "site-file.md": page(SITE),
        "components.md": components_page.page(),
        "models.md": models_page.page(),
    }


if __name__ == "__main__":
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
        print(FOLDER.name, name)
