"""Settings of a ROS 1 source: one topic."""

from __future__ import annotations

from dataclasses import dataclass

from evertwin.ros.spec import Masters
from evertwin.settings.kinds import Duration
from evertwin.sources.live.contract import LiveSettings


@dataclass(frozen=True)
class RosSettings(Masters, LiveSettings):
    """``protocol = "ros"``: one topic of a ROS 1 master. Columns have the names that a bag gives
    them (``/odom.pose.pose.position.x``, time ``/odom.stamp`` or ``/odom.logged``).

    >>> RosSettings("odom", "ros").topic
    ''
    """

    topic: str = ""
    """The topic here, where it has another name than in the twin file's columns."""
    silence: Duration | None = None
    """A silence of so long is a line that is down, and is connected again; absent: none is."""
