"""Sources: recorded files in, chunks of one source in SI units on a clean clock out.

`open_recording` tells the format from the content; `inspect` describes a file and what is wrong
with it; `Recorded` turns files into chunks; `merge` puts several sources in order of their stamps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.sources.contract import Source, check_source
    from evertwin.sources.description import ColumnInfo, Info, TableInfo, TimeInfo
    from evertwin.sources.guard import Rules
    from evertwin.sources.info import inspect
    from evertwin.sources.info_text import render
    from evertwin.sources.merging import merge
    from evertwin.sources.proposal import Match, Proposal, propose
    from evertwin.sources.recorded import Cell, Clock, Recorded
    from evertwin.sources.recording import open_recording
    from evertwin.sources.table import Column, Problem, Recording, Rows, Table
    from evertwin.sources.tally import Tally
    from evertwin.sources.writers import write

__all__ = [
    "Cell",
    "Clock",
    "Column",
    "ColumnInfo",
    "Info",
    "Match",
    "Problem",
    "Proposal",
    "Recorded",
    "Recording",
    "Rows",
    "Rules",
    "Source",
    "Table",
    "TableInfo",
    "Tally",
    "TimeInfo",
    "check_source",
    "inspect",
    "merge",
    "open_recording",
    "propose",
    "render",
    "write",
]

__getattr__ = surface(__name__)
