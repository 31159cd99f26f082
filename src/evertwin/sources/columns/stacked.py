"""Tables with a row for each signal and moment, as of historians: a tag, a stamp and a value."""

from __future__ import annotations

from evertwin.sources.columns.names import listed
from evertwin.sources.columns.table import Column, Table

_ROWS = 3000
"""Rows that it is told from."""
_ALONE, _REPEAT = 0.95, 0.75
"""Share of rows that stamp and tag tell apart at least, and stamps alone at most."""


def stacked(table: Table, time: Column) -> str:
    """The sentence where the rows of one moment are of several signals, which a column names; else
    empty.

    >>> import tempfile
    >>> from pathlib import Path
    >>> from evertwin.sources import open_recording
    >>> file = Path(tempfile.mkdtemp()) / "tags.csv"
    >>> rows = (f"{tag},{t},{t % 7}" for t in range(20) for tag in ("LT1", "FT2"))
    >>> _ = file.write_text("\\n".join(["tag,time,value", *rows]) + "\\n")
    >>> one = open_recording(file).tables[0]
    >>> stacked(one, one.columns[1]).split(":")[0]
    "each row is of one signal (LT1; FT2, named in 'tag'), a twin needs a column for each"
    """
    stamps = _cells(table, time)
    if len(set(stamps)) > _REPEAT * len(stamps):
        return ""
    for column in table.columns:
        tags = _cells(table, column) if column.kind == "text" else []
        names = list(dict.fromkeys(tags))
        if 1 < len(names) <= len(tags) / 3 and (
            len(set(zip(stamps, tags, strict=True))) > _ALONE * len(tags)
        ):
            value = next((c.name for c in table.columns if c.kind == "number" and c != time), "")
            return (
                f"each row is of one signal ({listed(names, 4)}, named in {column.name!r}), a twin "
                f"needs a column for each: export it so, or pandas: table.pivot("
                f"index={time.name!r}, columns={column.name!r}, values={value!r})"
            )
    return ""


def lists(table: Table) -> list[str]:
    """The columns whose cells hold several numbers each, as messages printed to a table do."""
    out = []
    for column in table.columns:
        cells = _cells(table, column)[:1] if column.kind == "text" else []
        for cell in cells:
            if cell[:1] in tuple("[({") and any(sign.isdigit() for sign in cell):
                out.append(
                    f"{column.name}: each cell holds several values ({cell[:24]} …): write a "
                    "column for each of them"
                )
    return out


def _cells(table: Table, column: Column) -> list[str]:
    rows = next(iter(table.rows([], column.name, strict=False)), None)
    cells = [] if rows is None else rows.time[:_ROWS].tolist()
    return [c.decode("utf-8", "replace") if isinstance(c, bytes) else str(c) for c in cells]
