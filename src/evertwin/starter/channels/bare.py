"""Tables under bare names, which tell columns from one another, and their full names again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from evertwin.sources.columns.description import TableInfo
from evertwin.starter.looks.apart import bare
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import Proposal


def told_apart(seen: Sequence[Seen]) -> tuple[tuple[Seen, ...], dict[tuple[int, str], str]]:
    """The tables with bare names, and the full name of each: (table, bare name) → name."""
    every = dict.fromkeys(c.name for one in seen for c in one.table.columns)
    numbers = dict.fromkeys(c.name for one in seen for c in one.columns)
    short = bare(tuple(every), tuple(numbers))
    out, full = list[Seen](), dict[tuple[int, str], str]()
    for s, one in enumerate(seen):
        columns = tuple(replace(c, name=short[c.name]) for c in one.table.columns)
        full |= {(s, short[c.name]): c.name for c in one.table.columns}
        time, clocks = one.table.time, one.table.clocks
        table = replace(
            one.table, name=_bare_topic(one.table, short), columns=columns,
            time=time and replace(time, column=short.get(time.column, time.column)),
            clocks=tuple(replace(c, column=short.get(c.column, c.column)) for c in clocks),
        )  # fmt: skip
        out.append(replace(one, table=table))
    return tuple(out), full


def _bare_topic(table: TableInfo, short: Mapping[str, str]) -> str:
    """A topic's name without what its columns' names have lost."""
    lost = {len(c.name) - len(short[c.name]) for c in table.columns if c.name in short}
    return table.name[min(lost, default=0) :] if table.name else ""


def restored(found: Proposal, full: Mapping[tuple[int, str], str]) -> Proposal:
    """A proposal with the names that the recordings have."""
    names = {short: name for (_, short), name in full.items()}
    return replace(
        found,
        matches=tuple(
            replace(m, column=full.get((m.source, m.column), m.column)) for m in found.matches
        ),
        unused=tuple(names.get(name, name) for name in found.unused),
    )
