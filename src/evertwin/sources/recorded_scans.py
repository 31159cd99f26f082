"""Recorded scans as chunks of arrays: a bag's or a CARMEN log's, or columns of a table.

A table has a column for each beam, counted from 1: ``ranges.1``, ``ranges.2``, … Their stamps are
guarded as those of any source; where a beam has no value nothing came back. What scans and their
recording say besides (poses, odometry) is not looked at.

>>> import tempfile
>>> file = Path(tempfile.mkdtemp()) / "run.csv"
>>> _ = file.write_text("t,ranges.1,ranges.2\\n0.0,1.5,2.5\\n0.5,1.4,\\n")
>>> spec = ArraySpec("scan", (2,), column="ranges")
>>> [(chunk.t.tolist(), chunk.v.tolist()) for chunk in RecordedScans(spec, (file,)).read()]
[([0, 500000000], [[1.5, 2.5], [1.4, nan]])]
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from evertwin.errors import DataError
from evertwin.fold import Chunk
from evertwin.sources.clocks.tally import Tally
from evertwin.sources.columns.cells import Cell
from evertwin.sources.columns.scans import Lidar, Scans
from evertwin.sources.recorded import Clock, Recorded
from evertwin.sources.recording import open_recording
from evertwin.sources.robot_logs.bag_scans import BAGS, scans_of
from evertwin.sources.spec import ArraySpec

LOGS = (*BAGS, "carmen")
"""Kinds of recordings that hold scans as such."""


@dataclass(frozen=True)
class RecordedScans:
    """Files of one lidar, in the order given, each a task.

    >>> RecordedScans(ArraySpec("scan", (180,)), ()).lidar is None
    True
    """

    spec: ArraySpec
    files: tuple[Path, ...]
    tally: Tally = field(default_factory=Tally, compare=False)
    """Problems found while reading."""
    unit: float = 1.0
    """Of a table's ranges [m]; scans as such are in metres."""
    _kept: dict[Path, Scans | None] = field(default_factory=dict, init=False, compare=False)

    @property
    def lidar(self) -> Lidar | None:
        """Where the beams look, as the first recording says; None: it does not.

        Raises:
            DataError: it cannot be read, or has other beams than the twin file says.
        """
        found = self._scans(self.files[0]) if self.files else None
        return None if found is None else found.lidar

    def read(self) -> Iterator[Chunk]:
        """The scans, (n, shape), [m].

        Raises:
            DataError: with file and what was expected.
        """
        for task, file in enumerate(self.files):
            found = self._scans(file)
            if found is not None:
                self.tally.used += len(found.t)
                yield Chunk(self.spec.name, found.t, found.ranges, task)
                continue
            for chunk in self._table(file).read():
                v = self.unit * chunk.v.reshape(-1, *self.spec.shape)
                yield chunk._replace(v=v, task=task)

    def _scans(self, file: Path) -> Scans | None:
        """The scans that a file holds as such."""
        if file not in self._kept:
            recording = open_recording(file)
            self._kept[file] = None
            if recording.kind in LOGS:
                self._kept[file] = self._checked(file, scans_of(recording, self._topic))
        return self._kept[file]

    @property
    def _topic(self) -> str:
        return self.spec.column.removesuffix(".ranges")

    def _checked(self, file: Path, found: tuple[Scans, ...]) -> Scans:
        """The one lidar.

        Raises:
            DataError: there is none, or it has other beams.
        """
        if not found:
            raise DataError(f"{file.name}: source {self.spec.name!r}: expected scans, found none")
        one, beams = found[0], math.prod(self.spec.shape)
        if one.ranges.shape[1] != beams:
            raise DataError(
                f"{file.name}: {one.name} has {one.ranges.shape[1]} beams, the twin file says "
                f"{beams}: correct shape of [[array]] {self.spec.name!r}"
            )
        self.tally.notes += [*one.findings, *[one.assumed] * bool(one.assumed)]
        return one

    def _table(self, file: Path) -> Recorded:
        spec, time = self.spec, self.spec.time
        names = [f"{spec.column}.{k + 1}" for k in range(math.prod(spec.shape))]
        cells = tuple(Cell(name, name, "1") for name in names)
        clock = Clock(time.column, time.unit, time.rate)
        return Recorded(spec.name, (file,), cells, clock, tally=self.tally, sparse=True)
