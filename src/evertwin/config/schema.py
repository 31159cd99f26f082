"""The JSON schema of the twin file, for editors: from the same classes that read it.

An editor that knows TOML schemas completes keys and marks mistakes while typing, given a first line
such as ``#:schema evertwin.schema.json`` and that file from ``evertwin schema``.

>>> content = schema()
>>> content["required"], content["properties"]["clock"]["$ref"]
(['schema', 'name', 'model'], '#/$defs/ClockSpec')
"""

from __future__ import annotations

from collections.abc import Mapping

import evertwin.settings.schema as forms
from evertwin.config.spec import SCHEMA, TwinSpec
from evertwin.settings.fields import Section
from evertwin.types import Json

__all__ = ["schema", "sections"]


def schema() -> Mapping[str, Json]:
    """The schema (draft 2020-12), as plain values."""
    return forms.schema(TwinSpec, SCHEMA, "evertwin twin file")


def sections() -> tuple[type[Section], ...]:
    """Every section that a twin file can hold, the whole file first."""
    return forms.sections(TwinSpec)
