"""What a ``[[source]]`` of the twin file is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from evertwin.starter.proposal import Match


@dataclass(frozen=True)
class Source:
    """One ``[[source]]`` of the twin file.

    >>> Source("log", ("run.csv",), "", None, None, ()).name
    'log'
    """

    name: str
    files: tuple[str, ...]
    match: str
    """Pattern of its files' names; empty where there is one source."""
    time: Any
    period: float | None
    """Seconds from row to row: of the column of time, or what a constant column says."""
    matches: tuple[Match, ...]
    holds: bool = False
    """Are these commands, which hold from one row to the next however far it is?"""
    task: str = ""
    """Column that tells one experiment from the next."""
    answered: bool = False
    """Is it a person who says how far the rows are apart?"""
