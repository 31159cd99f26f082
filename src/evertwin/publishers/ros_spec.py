"""Settings of the ROS publisher."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, ClassVar, TypeAlias

from annotated_types import Gt

from evertwin.errors import UsageError
from evertwin.publishers.contract import PublisherSettings
from evertwin.ros.spec import Masters
from evertwin.settings.notes import Quantity

Metres: TypeAlias = Annotated[float, Quantity("m"), Gt(0.0)]


@dataclass(frozen=True)
class RosOutSettings(Masters, PublisherSettings):
    """``protocol = "ros"`` of a publisher: topics of a ROS 1 master below ``/evertwin/NAME``. It
    publishes no command, joint command, goal or parameter.

    >>> RosOutSettings("ros").diagnostics
    '/diagnostics'
    """

    files: ClassVar[tuple[str, ...]] = ("maps",)

    topic: str = "/evertwin"
    """What all topics begin with: ``TOPIC/NAME/prediction``, for a base ``/path``, ``/measured``,
    ``/markers`` too. In NAME each sign that ROS does not know becomes ``_``."""
    diagnostics: str = "/diagnostics"
    """Topic of health and residuals (``diagnostic_msgs/DiagnosticArray``), once a second."""
    map: str = "map"
    """Frame in which the pose of a base is measured and predicted; that of its odometry (``odom``)
    where nothing but its odometry measures it."""
    odom: str = ""
    """Frame of the machine's own odometry, as in ``odom``: it is placed in ``map`` by each position
    update (REP-105), as a localisation does. Empty: no transform is published. Set it only where
    the machine has no other localisation: when another node places the frame, this one stops."""
    base: str = "base_link"
    """Frame of the machine that its odometry places in ``odom``."""
    maps: str = ""
    """Folder of ``evertwin map -o`` and ``evertwin tables -o``: ``TOPIC/NAME/map`` and ``costs``
    (``nav_msgs/OccupancyGrid``) and ``tables`` (``visualization_msgs/MarkerArray``) say what stands
    in its files, again when these change. Its origin is that of the frame ``map``."""
    size: Metres = 0.4
    """Diameter of the ghost."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("topic", "diagnostics"):
            name = getattr(self, key)
            if not re.fullmatch(r"(/[A-Za-z][A-Za-z0-9_]*)+", name):
                raise UsageError(f"{key}: expected a ROS name such as /evertwin, got {name!r}")
