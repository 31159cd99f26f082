"""The reference page of the twin file, from the same classes that read it.

>>> "| `rate` | quantity in Hz, above 0 | absent |" in page()
True
"""

from __future__ import annotations

import evertwin.settings.page as pages
from evertwin.config.spec import TwinSpec

__all__ = ["page"]

_OPENING = """# The twin file

A twin file is TOML: one section a concept, one key a setting. A quantity is a number in SI, or text
with its unit (`"2 cm"`). `${NAME}` and `${NAME:-default}` are replaced from the environment. An
unknown key is an error that names the nearest one and its line; numbers outside their range are
refused.
"""


def page() -> str:
    """Markdown: one table for each section."""
    return pages.page(TwinSpec, _OPENING)
