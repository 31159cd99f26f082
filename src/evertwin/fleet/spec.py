"""Settings of a fleet."""

from __future__ import annotations

import ipaddress
import re
import socket
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import parse_qs, urlsplit

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.settings.kinds import Duration
from evertwin.settings.section import Section

SAFE = ("verify-full", "verify-ca")


@dataclass(frozen=True)
class FleetSpec(Section):
    """``[fleet]``: several machines share the twins of this file; each twin runs on one of them.

    >>> FleetSpec("postgresql://evertwin@127.0.0.1/plant", node="north").lease
    10.0
    """

    store: str = ""
    """PostgreSQL server that all nodes share, as in "postgresql://user@host/database"; beyond this
    machine with ``?sslmode=verify-full``. A password belongs into the user's ``.pgpass``. Absent:
    one machine, with the folder ``store``."""
    node: str = ""
    """Name of this machine in the fleet; absent: its host name."""
    lease: Annotated[Duration, Ge(0.5), Le(600.0)] = 10.0
    """A node that is not heard of for so long loses its twins to others."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.node and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", self.node):
            raise UsageError(f"node: expected letters, digits, - _ and dots, got {self.node!r}")
        if not self.store:
            return
        told = urlsplit(self.store)
        if told.scheme not in ("postgresql", "postgres"):
            raise UsageError(
                f"store: expected postgresql://user@host/database, got {told.scheme or 'no'} scheme"
            )
        if told.password:
            raise UsageError(
                "store: a password belongs into the user's .pgpass, not into this file"
            )
        mode = parse_qs(told.query).get("sslmode", [""])[0]
        if not _here(told.hostname or "") and mode not in SAFE:
            raise UsageError(
                f"store: {told.hostname} is another machine: expected ?sslmode=verify-full"
            )

    @property
    def name(self) -> str:
        """What this node is called."""
        return self.node or socket.gethostname()


def _here(host: str) -> bool:
    """This machine, or a socket in a folder?"""
    if host in ("", "localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
