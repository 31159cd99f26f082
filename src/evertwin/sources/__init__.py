"""Sources: recorded files in, chunks of one source in SI units on a clean clock out.

`open_recording` tells the format from the content; `inspect` describes a file and what is wrong
with it; `Recorded` turns files into chunks; `merge` puts several sources in order of their stamps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.sources.clocks.tally import Tally as Tally
    from evertwin.sources.columns.cells import Cell as Cell
    from evertwin.sources.columns.description import (
        ColumnInfo as ColumnInfo,
        Info as Info,
        TableInfo as TableInfo,
        TimeInfo as TimeInfo,
    )
    from evertwin.sources.columns.table import (
        Column as Column,
        Problem as Problem,
        Recording as Recording,
        Rows as Rows,
        Table as Table,
    )
    from evertwin.sources.contract import Source as Source, check_source as check_source
    from evertwin.sources.info import inspect as inspect
    from evertwin.sources.info_text import render as render
    from evertwin.sources.merging import merge as merge
    from evertwin.sources.recorded import Clock as Clock, Recorded as Recorded
    from evertwin.sources.recording import open_recording as open_recording
    from evertwin.sources.writers import Lists as Lists, write as write

__getattr__ = surface(__name__)
