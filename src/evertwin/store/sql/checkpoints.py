"""Checkpoints in the store's file: the newest few of the newest run, in pieces that they share.

What is shown of a run's rows is appended once, checkpoint by checkpoint.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from evertwin.errors import StoreDamaged
from evertwin.store.chain import SEED
from evertwin.store.contract import Checkpoint
from evertwin.store.sql.arrays import pack, unpack
from evertwin.store.sql.database import Sql, Writing
from evertwin.store.sql.pieces import cut, joined, name_of, names_in, proof

S = TypeVar("S")
log = logging.getLogger("evertwin")
KEPT = 3
"""Checkpoints that stay."""
QUERY = "SELECT run, row, length, chunks, shown, layout, hash FROM checkpoints WHERE row < ?"


class Checkpoints:
    """The checkpoints of a database.

    >>> from evertwin.store.sql.database import Database
    >>> Checkpoints(Database(":memory:")).restore((0.0,)) is None
    True
    """

    def __init__(self, database: Sql) -> None:
        self._database = database
        found = database.query("SELECT number, run, layout FROM checkpoints")
        self._kept = {number: (run, names_in(layout)) for number, run, layout in found}
        parts = database.query("SELECT run, hash FROM shown ORDER BY number")
        self._shown = (parts[-1][0] if parts else 0, *shown_proof([name for _, name in parts]))
        """Run, parts, and a hash over them."""

    def write(self, db: Writing, checkpoint: Checkpoint, samples: int, *, whole: bool) -> None:
        """Inside a transaction, behind so many samples; not ``whole``: a newer state follows in it
        and is kept."""
        run = checkpoint.run
        if run != self._shown[0]:
            db.execute("DELETE FROM shown")
            self._shown = (run, *shown_proof(()))
        if checkpoint.shown:
            content = pack(checkpoint.shown)
            self._shown = (run, *shown_proof([name_of(content)], *self._shown[1:]))
            part = (self._shown[1], run, content, name_of(content))
            db.execute("INSERT INTO shown VALUES (?, ?, ?, ?)", part)
        if not whole:
            return
        layout, pieces = cut(checkpoint.state)
        ((length, end),) = db.execute("SELECT length, hash FROM head")
        _, shown, proven = self._shown
        chunks = checkpoint.chunks if checkpoint.chunks >= 0 else samples
        row = (run, checkpoint.row, length, chunks, shown, layout)
        there = _names(self._kept)
        fresh = [(name, piece) for name, piece in pieces.items() if name not in there]
        db.executemany("INSERT INTO pieces VALUES (?, ?) ON CONFLICT DO NOTHING", fresh)
        number = max(self._kept, default=0) + 1
        told = (number, *row, proof(*row, end, proven))
        db.execute("INSERT INTO checkpoints VALUES (?, ?, ?, ?, ?, ?, ?, ?)", told)
        kept = {n: one for n, one in self._kept.items() if n > number - KEPT and one[0] == run}
        kept[number] = (run, set(pieces))
        gone = (there | set(pieces)) - _names(kept)
        db.execute("DELETE FROM checkpoints WHERE number <= ? OR run <> ?", (number - KEPT, run))
        db.executemany("DELETE FROM pieces WHERE name = ?", [(name,) for name in gone])
        self._kept = kept

    def restore(
        self, like: S, run: int | None = None, before: int | None = None
    ) -> Checkpoint | None:
        """The newest sound one (of a run, before a row) in the shape of ``like``, or None.

        Raises:
            StoreError: it was saved by another version.
        """
        chosen = "" if run is None else f" AND run = {int(run)}"
        end = 2**63 - 1 if before is None else before
        for found in self._database.query(f"{QUERY}{chosen} ORDER BY number DESC", (end,)):
            try:
                return self._restored(found, like)
            except StoreDamaged as error:
                log.warning(
                    "%s: checkpoint before row %d: %s", self._database.path, found[1], error
                )
        return None

    def _restored(self, found: Sequence[Any], like: S) -> Checkpoint:
        run, row, length, chunks, shown, layout, digest = found
        ends = self._database.query("SELECT hash FROM log WHERE number = ?", (length,))
        end = ends[0][0] if ends else SEED
        parts = self._database.query(
            "SELECT content, hash FROM shown WHERE run = ? ORDER BY number LIMIT ?", (run, shown)
        )
        _, proven = shown_proof([name_of(content) for content, _ in parts])
        if proof(run, row, length, chunks, shown, layout, end, proven) != digest:
            raise StoreDamaged("it does not match its hash")
        state = joined(layout, self._contents(sorted(names_in(layout))), like)
        return Checkpoint(row, state, run, length, chunks, _together([c for c, _ in parts]))

    def _contents(self, names: Sequence[str]) -> dict[str, bytes]:
        found: dict[str, bytes] = {}
        for at in range(0, len(names), 500):
            part = names[at : at + 500]
            marks = ", ".join("?" * len(part))
            query = f"SELECT name, content FROM pieces WHERE name IN ({marks})"
            found.update(self._database.query(query, part))
        return found

    def verify(self) -> None:
        """Every piece matches its name.

        Raises:
            StoreDamaged: names the first that does not.
        """
        for name, content in self._database.query("SELECT name, content FROM pieces"):
            if name_of(content) != name:
                raise StoreDamaged(f"piece {name[:12]} of a checkpoint was changed")


def _names(kept: Mapping[int, tuple[int, set[str]]]) -> set[str]:
    """The pieces that checkpoints need."""
    return {name for _, names in kept.values() for name in names}


def shown_proof(names: Sequence[str], count: int = 0, before: str = "") -> tuple[int, str]:
    """How many parts there are, and a hash over them in their order."""
    for name in names:
        count, before = count + 1, proof(before, name)
    return count, before


def _together(parts: Sequence[bytes]) -> dict[str, np.ndarray]:
    """Columns of which each part holds some rows."""
    found = [unpack(part) for part in parts]
    names = found[0] if found else {}
    return {name: np.concatenate([part[name] for part in found]) for name in names}
