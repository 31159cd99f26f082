"""Settings of the OPC UA publisher."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.publishers.contract import PublisherSettings
from evertwin.trust import Policy, check_secured


@dataclass(frozen=True)
class OpcuaOutSettings(PublisherSettings):
    """``protocol = "opcua"`` of a publisher: a server with variables that nobody can write.

    >>> OpcuaOutSettings("opcua").port
    4840
    """

    host: str = "127.0.0.1"
    """Address that the server listens at; beyond this machine only with ``security``."""
    port: Annotated[int, Ge(1), Le(65535)] = 4840
    security: Policy = "none"
    """Security policy; with any but ``none`` every session is signed and encrypted, and only
    clients in ``trust`` have one."""
    certificate: str = ""
    """The server's own certificate (.der or .pem), with its ``key``; all three are relative to the
    site file."""
    key: str = ""
    trust: str = ""
    """Folder with the client certificates that are trusted (.der or .pem)."""

    files = ("certificate", "key", "trust")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_secured(self.security, certificate=self.certificate, key=self.key, trust=self.trust)
        if self.security == "none" and not _here(self.host):
            raise UsageError(
                f"host: {self.host} is reached from other machines: expected security, as in "
                'security = "Basic256Sha256", with certificate, key and trust'
            )


def _here(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
