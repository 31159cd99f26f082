"""Settings of an OPC UA source: which node is which column.

>>> OpcuaSettings("arm", "opcua", nodes={"q1": "s=arm.q1"}, namespace="urn:a").node("s=arm.q1")
'nsu=urn:a;s=arm.q1'
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge

from evertwin.errors import UsageError
from evertwin.settings.kinds import Duration, Seconds
from evertwin.settings.notes import Late
from evertwin.sources.live.contract import LiveSettings
from evertwin.trust import Policy, check_secured


@dataclass(frozen=True)
class OpcuaSettings(LiveSettings):
    """``protocol = "opcua"``: variables of an OPC UA server, subscribed to. See the module for an
    example."""

    url: str = "opc.tcp://127.0.0.1:4840"
    """Address of the server."""
    namespace: str | None = None
    """URI of the nodes' namespace; its index is asked for with every connection, because a server
    may number its namespaces anew when it starts."""
    nodes: Mapping[str, str] = field(default_factory=dict)
    """Column of the twin file → its node: ``s=arm.q1`` in ``namespace``, or
    ``nsu=urn:machine;s=arm.q1``; ``i=`` and ``g=`` likewise."""
    period: Duration = 0.1
    """Sampling and publishing interval that the server is asked for."""
    together: Annotated[Seconds, Ge(0.0)] = 0.0005
    """Values whose source time stamps differ by so much at most are one sample."""
    timeout: Duration = 4.0
    """Longest wait for an answer."""
    security: Policy = "none"
    """Security policy; any but ``none`` signs and encrypts."""
    certificate: Annotated[str, Late()] | None = None
    """This end's own certificate, with its ``key``."""
    key: Annotated[str, Late()] | None = None
    trust: Annotated[str, Late()] | None = None
    """Folder with the server certificates that are trusted (.der or .pem). None is ever trusted on
    its own word."""
    user: str | None = None
    password_env: str | None = None
    """Environment variable that holds the password; it never stands in this file."""
    password_file: Annotated[str, Late()] | None = None
    """File that holds it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for node in self.nodes.values():
            self.node(node)
        check_secured(self.security, certificate=self.certificate, key=self.key, trust=self.trust)

    def node(self, text: str) -> str:
        """A node with the URI of its namespace.

        Raises:
            UsageError: it has none, or an index instead.
        """
        if text.startswith("nsu=") or (text.startswith("i=") and self.namespace is None):
            return text
        if text[:2] not in ("s=", "i=", "g=") or self.namespace is None:
            raise UsageError(
                f"nodes: {text!r}: expected 's=…', 'i=…' or 'g=…' with namespace = 'URI', or "
                "'nsu=URI;s=…': an index (ns=2) may mean another namespace after the next start"
            )
        return f"nsu={self.namespace};{text}"
