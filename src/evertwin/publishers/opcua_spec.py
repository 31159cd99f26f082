"""Settings of the OPC UA publisher."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from evertwin.publishers.contract import PublisherSettings


@dataclass(frozen=True)
class OpcuaOutSettings(PublisherSettings):
    """``protocol = "opcua"`` of a publisher: a server with variables that nobody can write.

    >>> OpcuaOutSettings("opcua").port
    4840
    """

    host: str = "127.0.0.1"
    """Address that the server listens at."""
    port: Annotated[int, Ge(1), Le(65535)] = 4840
