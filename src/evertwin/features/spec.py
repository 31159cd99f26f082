"""Settings of what a twin perceives: the pose by scans, what a detector confuses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from annotated_types import Ge, Gt, Le

from evertwin.errors import UsageError
from evertwin.models.tables.bodies import MOST_TABLES, table_channels
from evertwin.settings.kinds import Duration, Seconds
from evertwin.settings.notes import Late, Quantity
from evertwin.settings.section import Section
from evertwin.signals.units import compatible
from evertwin.sources.columns.scans import Lidar

Meters: TypeAlias = Annotated[float, Quantity("m", difference=True), Ge(-1e3), Le(1e3)]
Length: TypeAlias = Annotated[float, Quantity("m", difference=True), Gt(0.0)]
Angle: TypeAlias = Annotated[float, Quantity("rad", difference=True), Ge(-7.0), Le(7.0)]


@dataclass(frozen=True)
class PerceptionSpec(Section):
    """``[perception]``: the pose of a base by its scans, sample by sample, recorded and live.

    >>> PerceptionSpec("scan", step=0.1).pose
    ('x', 'y', 'heading')
    """

    scan: str
    """The ``[[array]]`` of ranges, one for each beam. In a recording they are a bag's scans on the
    topic of its ``column`` (``/scan.ranges``), those of a CARMEN log (``FLASER``), or the columns
    ``ranges.1``, ``ranges.2``, … of a table."""
    start: Angle | None = None
    """Angle of the first beam, 0 ahead, to the left positive; absent: as the recording says."""
    step: Angle | None = None
    """Angle from beam to beam; absent: as the recording says. A running machine and a table do not
    say it."""
    longest: Length = math.inf
    """From this range on nothing came back."""
    unit: str = "m"
    """Unit of the ranges."""
    ahead: Meters = 0.0
    """Where the lidar is on the machine: ahead of the point whose pose is told."""
    left: Meters = 0.0
    """The same, to the left of it."""
    turned: Angle = 0.0
    """Where the lidar looks, to the left of ahead."""
    wheels: tuple[str, ...] = ()
    """Channels of one source: x, y and heading by the wheels; absent: scans are matched without."""
    gyro: str = ""
    """Channel with the turn rate; absent: as above."""
    pose: tuple[str, ...] = ("x", "y", "heading")
    """Names of the channels that come of it, in the frame of the first scan."""
    tables: Annotated[int, Ge(0), Le(MOST_TABLES)] = 0
    """Places for tables on legs that the scans show, in the frame of the pose: each becomes the
    channels ``table1.x``, ``.y``, ``.heading``, ``.length``, ``.width``, ``.leg`` (all 0: none
    stands there), inputs of a model that knows tables. What came, was moved or went is told."""
    every: Duration | None = None
    """A pose for the first scan of each such time; absent: for every scan. Others are matched."""
    within: Length = 0.1
    """Standard deviation of the place from which on a pose is none."""
    silent: Duration = 1.0
    """How long a scan waits for wheels and gyro, and how long they may say nothing."""
    slack: Annotated[Seconds, Ge(0.0)] = 0.0
    """How far behind the newest pose another source's sample may still come; rows wait for it."""
    timeout: Duration = math.inf
    """Without a scan for so long before a tick, rows leave without a pose."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.step == 0.0 or (self.start is not None and self.step is None):
            raise UsageError("step: expected the angle from beam to beam, as in '1 deg', not 0")
        if len(self.wheels) not in (0, 3):
            raise UsageError(
                "wheels: expected three channels, x, y and heading, or none, got "
                f"{len(self.wheels)}"
            )
        if len(set(self.pose)) != 3:
            raise UsageError(f"pose: expected three names, got {', '.join(self.pose) or 'none'}")
        if not compatible(self.unit, "m"):
            raise UsageError(f"unit: expected one of length, as 'm' or 'mm', got '{self.unit}'")

    @property
    def channels(self) -> tuple[str, ...]:
        """All that comes of it."""
        return (*self.pose, *table_channels(self.tables))

    @property
    def mount(self) -> tuple[float, float, float]:
        """Of the lidar on the machine (m, m, rad)."""
        return self.ahead, self.left, self.turned

    def lidar(self, beams: int) -> Lidar | None:
        """What is said of it; None: its angles are not. Beams of which only the step is known
        look as far to the left as to the right.

        >>> PerceptionSpec("scan", start=0.0, step=0.1).lidar(5).angles(5)[-1]
        np.float64(0.4)
        """
        if self.step is None:
            return None
        even = Lidar.ahead(beams, self.step, self.longest)
        start = even.start if self.start is None else self.start
        return Lidar(start, self.step, self.longest, self.mount)


@dataclass(frozen=True)
class LabelsSpec(Section):
    """``[labels]``: what a detector says of things whose class is known, against what it said
    before: an event tells when it takes one for another more or less often.

    >>> LabelsSpec("labels", "known.csv").per
    200000.0
    """

    source: str
    """The ``[[array]]`` of labels, each of ``shape = [3]``: truth and label by their number, from 0
    in the order of ``classes``, and probability; of ``[4]`` with the number of the group (scene)
    that it belongs to. A recording has them as columns: ``values.1``, …"""
    known: Annotated[str, Late()]
    """File (CSV) of the labels that are known, as for ``evertwin confusions``; relative to the twin
    file."""
    classes: tuple[str, ...] = ()
    """Their names in the order of their numbers; absent: those of ``known``, by the alphabet."""
    per: Annotated[float, Ge(1.0), Le(6e7)] = 2e5
    """Labels that do not drift of which at most one raises an event, on average."""
