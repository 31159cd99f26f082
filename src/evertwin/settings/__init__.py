"""Files that people write: TOML in, frozen dataclasses out, with a schema and a reference page.

A file's form is a tree of `Section` classes. What a setting may be is said once, in its annotation
(`fields`); reading with all mistakes and their lines (`parse`), the JSON schema (`schema`) and the
reference page (`page`) follow from it. Which files there are is not known here: the twin file is
`evertwin.config`, the breakdown of a machine is `evertwin.engineering.breakdown`.
"""
