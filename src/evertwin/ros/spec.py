"""Where a ROS master is, and which Python speaks for us."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple
from urllib.parse import urlsplit

from evertwin.errors import UsageError
from evertwin.settings.section import Section

MASTER = "http://127.0.0.1:11311"
PYTHON = "/usr/bin/python3"


class Place(NamedTuple):
    """A master, and the Python that has rospy.

    >>> Place().master
    'http://127.0.0.1:11311'
    """

    master: str = MASTER
    python: str = PYTHON

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the master."""
        parts = urlsplit(self.master)
        return parts.hostname or "", parts.port or 0


@dataclass(frozen=True)
class Masters(Section):
    """What every section that speaks ROS is told.

    >>> Masters().place.address
    ('127.0.0.1', 11311)
    """

    master: str = MASTER
    """Address of the master; ``${ROS_MASTER_URI}`` takes it from the environment."""
    python: str = PYTHON
    """The Python that has rospy, which speaks for this end in a process of its own."""

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            host, port = self.place.address
        except ValueError:
            host, port = "", 0
        if not self.master.startswith("http://") or not host or not port:
            raise UsageError(f"master: expected http://HOST:PORT, got {self.master!r}")

    @property
    def place(self) -> Place:
        """Both together."""
        return Place(self.master, self.python)
