"""``evertwin schema``: the JSON schema of each kind of file that people write."""

from __future__ import annotations

import json
from typing import Any

import typer

from evertwin.ahead.spec import SCENARIO
from evertwin.config import TWIN
from evertwin.engineering.breakdown import BREAKDOWN
from evertwin.service.site.site_spec import SITE
from evertwin.settings.form import Form
from evertwin.settings.schema import schema


def show_schema(form: str, as_json: bool) -> None:
    """``evertwin schema``: of one form; with ``--json`` it names itself as
    every other document does."""
    forms: dict[str, Form[Any]] = {
        "twin": TWIN, "breakdown": BREAKDOWN, "scenario": SCENARIO,
        "site": SITE,
    }  # fmt: skip
    found = schema(forms[form])
    content = {"schema": "evertwin.schema/1", **found} if as_json else found
    typer.echo(json.dumps(content, indent=2))
