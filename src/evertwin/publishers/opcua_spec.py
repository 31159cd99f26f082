"""Settings of the OPC UA publisher."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, Self

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.publishers.contract import PublisherSettings

FILES = ("certificate", "key", "trust")


@dataclass(frozen=True)
class OpcuaOutSettings(PublisherSettings):
    """``protocol = "opcua"`` of a publisher: a server with variables that nobody can write.

    >>> OpcuaOutSettings("opcua").port
    4840
    """

    host: str = "127.0.0.1"
    """Address that the server listens at; beyond this machine only with ``security``."""
    port: Annotated[int, Ge(1), Le(65535)] = 4840
    security: Literal["none", "Basic256Sha256", "Aes128Sha256RsaOaep", "Aes256Sha256RsaPss"] = (
        "none"
    )
    """Security policy; with any but ``none`` every session is signed and encrypted, and only
    clients in ``trust`` have one."""
    certificate: str = ""
    """The server's own certificate (.der or .pem), with its ``key``; all three are relative to the
    site file."""
    key: str = ""
    trust: str = ""
    """Folder with the client certificates that are trusted (.der or .pem)."""

    def at(self, folder: Path) -> Self:
        """The same with paths relative to ``folder``."""
        certificate, key, trust = (
            str(folder / text) if text else "" for text in (self.certificate, self.key, self.trust)
        )
        return replace(self, certificate=certificate, key=key, trust=trust)

    def __post_init__(self) -> None:
        super().__post_init__()
        lacking = [name for name in FILES if not getattr(self, name)]
        if self.security != "none" and lacking:
            raise UsageError(
                f"security = {self.security!r}: needs {', '.join(lacking)}: the own certificate "
                "and key, and a folder with the certificates that are trusted"
            )
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
