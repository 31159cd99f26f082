"""The JSON schema and the reference page of the breakdown file, from the classes that read it.

>>> content = schema()
>>> content["required"], content["properties"]["requirements"]["$ref"]
(['schema', 'name'], '#/$defs/Requirements')
>>> "| `negligible` | number, above 0 and below 1 | `0.05` |" in page()
True
"""

from __future__ import annotations

from collections.abc import Mapping

import evertwin.settings.page as pages
import evertwin.settings.schema as forms
from evertwin.engineering.breakdown import SCHEMA, Breakdown
from evertwin.types import Json

__all__ = ["page", "schema"]

_OPENING = """# The breakdown file

A breakdown file is TOML: machine → systems → sub-systems → components, and what is known of each.
`evertwin engineer` makes a twin file of it. A quantity is a number in SI, or text with its unit
(`"400 ms"`, `"30 %"`). What holds of several components alike is said once, under `[like.NAME]`; a
component with `like = "NAME"` says only what differs. An unknown key is an error that names the
nearest one and its line.

Grades go from 1 to 5. Effect on the machine's health: 1 none, 2 little, 3 quality suffers, 4 the
machine runs badly, 5 it stops. Proneness to failure: 1 never, 2 once in its life, 3 every few
years, 4 every year, 5 more often. Where no grade is given it is computed from the maintenance
history, a CSV with the columns `date`, `component` and `downtime [h]`.

The JSON schema for editors comes from `evertwin schema --breakdown`.
"""


def schema() -> Mapping[str, Json]:
    """The schema (draft 2020-12), as plain values."""
    return forms.schema(Breakdown, SCHEMA, "evertwin breakdown file")


def page() -> str:
    """Markdown: one table for each section."""
    return pages.page(Breakdown, _OPENING)
