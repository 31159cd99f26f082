"""Reports: each is one self-contained HTML file. Pictures are inside, nothing is loaded."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from evertwin.errors import UsageError
from evertwin.files import write_whole


def write_page(template: str, path: Path, content: Mapping[str, Any]) -> None:
    """Renders a template of ``report/templates`` into a file.

    Raises:
        UsageError: the file cannot be written, or is there and no page.
    """
    if path.is_file() and path.read_bytes()[:14].lower() not in (b"", b"<!doctype html"):
        raise UsageError(f"{path}: is there and is no report: choose another name, or delete it")
    write_whole(path, _pages().get_template(template).render(content))


@cache
def _pages() -> Environment:
    environment = Environment(
        loader=PackageLoader("evertwin.report", "templates"), autoescape=select_autoescape()
    )
    environment.filters["shown"] = shown
    return environment


def shown(value: Any) -> str:
    """A figure as a person reads it.

    >>> shown(0.12345678), shown(1.9e7), shown([]), shown(None), shown("x"), shown(30)
    ('0.1235', '1.9e+07', 'none', '-', 'x', '30')
    """
    if value is None:
        return "-"
    if isinstance(value, bool | str | int):
        return str(value)
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {shown(item)}" for key, item in value.items()) or "none"
    return ", ".join(shown(item) for item in value) or "none"
