"""Settings of the MQTT publisher."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from evertwin.errors import UsageError
from evertwin.publishers.contract import PublisherSettings


@dataclass(frozen=True)
class MqttOutSettings(PublisherSettings):
    """``protocol = "mqtt"`` of a publisher: topics below ``topic/NAME``.

    >>> MqttOutSettings("mqtt").topic
    'evertwin'
    """

    host: str = "127.0.0.1"
    """Of the broker."""
    port: Annotated[int, Ge(1), Le(65535)] = 1883
    topic: str = "evertwin"
    """What all topics begin with: ``TOPIC/NAME/rows``, ``/events``, ``/health``, ``/online``,
    ``/life`` (how long components last, after each new value); a question to ``/ask`` is answered
    at ``/answer``: ``{"id": 1, "whatif": {…}}``, ``forecast`` or ``life``."""
    user: str = ""
    password: str = ""
    """Write ``${NAME}`` to take it from the environment."""
    authority: str = ""
    """File with the certificates that the broker's is checked against (TLS); relative to the site
    file."""
    certificate: str = ""
    """File with the certificate of this client, and its key."""
    questions: bool = True
    """Are questions answered?"""
    files = ("authority", "certificate")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.topic or any(sign in self.topic for sign in "#+\0"):
            raise UsageError(f"topic: expected text without + and #, got {self.topic!r}")
