"""Files that people write: TOML in, frozen dataclasses out, with a schema.

A file's form (`form`) is a tree of `Section` classes. What a setting may be is said once, in its
annotation (`kinds`, `notes`). A text becomes a bounded `document`, its `patterns` written out, each
value with its line (`lines`); pydantic decodes it (`decode`) and makes the JSON schema (`schema`),
from which `tools/settings_page.py` writes the reference page. pydantic and not msgspec: it reports
every mistake of a file with its whole path, keys of tables included, and takes conversions such as
units by annotation.

Which files there are is not known here. Each room owns its settings (``spec.py``); the twin file is
made of them in `evertwin.config`, a scenario is in `evertwin.ahead.spec`, a machine's breakdown in
`evertwin.engineering.breakdown`.
"""
