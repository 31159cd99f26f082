"""The pose by scans as a source of its own: what it takes, what it brings.

Wheels and gyro are sources of the twin file. One that no channel of the model is made of makes no
rows: only the pose that comes of it does.

>>> from evertwin.config.spec import ModelSpec, PerceptionSpec
>>> from evertwin.machines.mobile import Differential
>>> from evertwin.sources.spec import ArraySpec
>>> spec = TwinSpec("base", ModelSpec("differential"), array=(ArraySpec("scan", (60,)),),
...                 perception=PerceptionSpec("scan", step=0.1))
>>> command = Feed("command", ("v", "w"))
>>> [one.channels for one in with_pose(spec, ("v", "w", "x"), (command,))]
[('v', 'w'), ('x', 'y', 'heading')]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evertwin.config import TwinSpec, place
from evertwin.config.spec import PerceptionSpec
from evertwin.errors import ConfigError, DataError
from evertwin.features.perception import Perception, PerceptionState
from evertwin.features.placed import Placed
from evertwin.fold import Chunk, Event, Out
from evertwin.signals.units import conversion_of
from evertwin.sources.columns.scans import Lidar
from evertwin.sync import Feed

DRIVES = "drives "
"""Before the name of a source whose inputs drive the machine."""


def with_pose(spec: TwinSpec, needed: Sequence[str], feeds: Sequence[Feed]) -> tuple[Feed, ...]:
    """``feeds`` as the alignment takes them: with the pose, without what it alone is made of.

    ``needed``: the channels that the model's are made of.
    """
    rule = spec.perception
    if rule is None or {*rule.pose} & {name for one in feeds for name in one.channels}:
        return tuple(feeds)  # where the pose is recorded it is no longer made
    priors = {*rule.wheels, rule.gyro}
    kept = [one for one in feeds if not priors & {*one.channels} or {*needed} & {*one.channels}]
    return (*kept, Feed(rule.scan, rule.channels, rule.slack, rule.timeout, framed=True))


@dataclass(frozen=True)
class Perceiving:
    """The stage before the alignment, for the sources of one twin file.

    >>> Perceiving.__name__
    'Perceiving'
    """

    stage: Perception
    rule: PerceptionSpec
    columns: dict[str, tuple[tuple[str, list[int]], ...]]
    """By source: as what of the stage, and which of its columns."""
    names: dict[str, tuple[str, ...]]
    """By source: its channels."""
    aligned: frozenset[str]
    """Sources that are aligned too."""
    unit: float
    """Of the ranges as they are pushed [m]."""

    @classmethod
    def of(
        cls, spec: TwinSpec, feeds: Sequence[Feed], brought: Sequence[Feed], lidar: Lidar | None,
        speeds: Sequence[str] = (),
    ) -> Perceiving | None:  # fmt: skip
        """For sources that bring ``feeds``, of which the alignment takes ``brought``; None: the
        pose is recorded.

        Args:
            spec: the twin file.
            feeds: all of them.
            brought: by `with_pose`.
            lidar: as the recording says; None: it does not.
            speeds: channels that drive the machine.

        Raises:
            ConfigError: nobody says where the beams look.
        """
        rule = spec.perception
        if rule is None or rule.scan not in {one.name for one in brought}:
            return None
        beams = next(one.shape[0] for one in spec.array if one.name == rule.scan)
        stated = rule.lidar(beams)
        if stated is None and lidar is None:
            raise ConfigError(
                f"{place(spec, ('perception', 'scan'))}: these scans do not say where their beams "
                "look: set start and step, as in start = '-90 deg', step = '1 deg'"
            )
        if stated is None and lidar is not None:
            mount = rule.mount if any(rule.mount) else lidar.mount
            stated = replace(lidar, longest=min(lidar.longest, rule.longest), mount=mount)
        assert stated is not None
        columns: dict[str, tuple[tuple[str, list[int]], ...]] = {}
        for one in feeds:
            driven = tuple(name for name in speeds if name in one.channels)
            parts = (("wheels", rule.wheels), ("gyro", (rule.gyro,) * bool(rule.gyro)),
                     (f"{DRIVES}{one.name}", driven))  # fmt: skip
            columns[one.name] = tuple(
                (what, [one.channels.index(name) for name in names])
                for what, names in parts if names and {*names} <= {*one.channels}
            )  # fmt: skip
        heard = {what for parts in columns.values() for what, _ in parts}
        stage = Perception(
            rule.scan, stated, beams, "wheels" if "wheels" in heard else "",
            "gyro" if "gyro" in heard else "", rule.silent, rule.within, rule.every or 0.0,
            tuple(sorted(what for what in heard if what.startswith(DRIVES))), rule.unit,
            rule.tables,
        )  # fmt: skip
        aligned = frozenset(one.name for one in brought) - {rule.scan}
        names = {one.name: one.channels for one in feeds}
        return cls(stage, rule, columns, names, aligned, conversion_of(rule.unit)[0])

    def init(self) -> PerceptionState:
        """The state before the first sample."""
        return self.stage.init()

    def step(
        self, state: PerceptionState, chunk: Chunk
    ) -> tuple[PerceptionState, list[Chunk | Event]]:
        """What is to be aligned when a chunk came, as if its samples came one by one: what is to be
        told, the poses that come of a sample, then the sample itself. Consumes ``state``."""
        state, out = self.stage.opened(state, chunk.task)
        pieces, first, aligned = [*self._told(out)], 0, chunk.source in self.aligned
        for i in range(len(chunk.t)):
            come = list[Event | Chunk]()
            for part in self._parts(chunk, i):
                state, out = self.stage.step(state, part)
                come += self._told(out)
            if come and aligned and i > first:
                pieces.append(_slice(chunk, first, i))
                first = i
            pieces += come
        if aligned:
            pieces.append(_slice(chunk, first, len(chunk.t)))
        return state, pieces

    def flush(self, state: PerceptionState) -> tuple[PerceptionState, list[Chunk | Event]]:
        """The same of the scans that wait, at the end of the data."""
        state, out = self.stage.flush(state)
        return state, [*self._told(out)]

    def check(self, chunk: Chunk) -> bool:
        """Is a chunk of a source that is aligned, too?

        Raises:
            DataError: it is not, and has another number of columns.
        """
        if chunk.source == self.rule.scan:
            return False
        if chunk.source in self.aligned or chunk.source not in self.names:
            return True
        width = len(self.names[chunk.source])
        if chunk.v.shape != (len(chunk.t), width):
            raise DataError(
                f"source {chunk.source!r}: expected {width} columns "
                f"({', '.join(self.names[chunk.source])}), got values of shape {chunk.v.shape}"
            )
        return False

    def _parts(self, chunk: Chunk, i: int) -> Iterator[Chunk]:
        """What a sample is to the stage: a scan, the wheels' pose, the turn rate."""
        t, v = chunk.t[i : i + 1], chunk.v[i : i + 1]
        if chunk.source == self.rule.scan:
            yield chunk._replace(t=t, v=self.unit * v)
        for what, columns in self.columns.get(chunk.source, ()):
            yield chunk._replace(source=what, t=t, v=v[:, columns])

    def _told(self, out: Out) -> Iterator[Event | Chunk]:
        """Events, then poses and tables."""
        yield from (one for one in out.records if isinstance(one, Event))
        placed: Placed | None = out.rows
        for k in range(0 if placed is None else len(placed.t)):
            assert placed is not None
            pose = placed.pose[k : k + 1]
            frame = np.where(np.isfinite(pose[:, :1]), placed.segment[k], np.nan)
            v = np.concatenate([pose, placed.tables[k : k + 1], frame], axis=1)
            yield Chunk(self.rule.scan, placed.t[k : k + 1], v, int(placed.task[k]))


def _slice(chunk: Chunk, first: int, stop: int) -> Chunk:
    return chunk._replace(t=chunk.t[first:stop], v=chunk.v[first:stop])
