"""What several commands take: each argument and option is said once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

PART = " FILE@START:STOP is a part, in seconds from the first stamp of all sources."
TwinFile = Annotated[Path, typer.Argument(help="Twin file (TOML).", metavar="TWIN.toml")]
SiteFile = Annotated[Path, typer.Argument(help="Site file (TOML).", metavar="SITE.toml")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Check = Annotated[bool, typer.Option("--check", help="Exit with 1 when there are findings.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")]
Report = Annotated[Path | None, typer.Option(help="Write a self-contained HTML report.")]
Scans = Annotated[Path, typer.Argument(help="Recording with scans.", metavar="RECORDING")]
Number = Annotated[int, typer.Argument(help="Number of a version.", metavar="VERSION")]
Reason = Annotated[str, typer.Option(help="Why; kept in the log.")]


def group(name: str, help: str) -> typer.Typer:
    """Commands below one word, such as ``evertwin store …``."""
    return typer.Typer(name=name, help=help, no_args_is_help=True, rich_markup_mode=None)
