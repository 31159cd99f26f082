"""Settings of an MQTT source: which topic and which part of its messages is which column.

>>> Part("pose.x").topic is None
True
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Le

from evertwin.settings.kinds import Duration
from evertwin.settings.notes import Late, Shorthand
from evertwin.settings.section import Section
from evertwin.sources.live.contract import LiveSettings


@dataclass(frozen=True)
class Part(Section):
    """``[twin.source.columns]``: one column. See the module for an example."""

    shorthand = Shorthand("path")

    path: str = ""
    """Place in the message's JSON, keys and positions with dots between them (``pose.x``, ``q.0``);
    empty: the message is the number."""
    topic: str | None = None
    """Absent: the topic of the source."""


@dataclass(frozen=True)
class MqttSettings(LiveSettings):
    """``protocol = "mqtt"``: messages of a broker, QoS 1, acknowledged when they are stored.

    >>> MqttSettings("robot", "mqtt", topic="robot/state").session
    86400.0
    """

    host: str = "127.0.0.1"
    """Name or address of the broker."""
    port: Annotated[int, Ge(1), Le(65535)] = 1883
    topic: str | None = None
    """Topic of the messages; no wildcards."""
    columns: Mapping[str, Part] = field(default_factory=dict)
    """Column of the twin file → its place; a column that is not named is the key of that name."""
    sequence: str | None = None
    """Place of a number that the publisher counts up: a gap is a counted loss."""
    publisher: str | None = None
    """Place of what tells one start of the publisher from the next (a boot number)."""
    client: str = ""
    """Name of this end, under which the broker keeps what came meanwhile; unique at the broker.
    Empty: made of the settings."""
    version: Literal[5, 3] = 5
    """MQTT 5, or 3.1.1."""
    session: Duration = 86400.0
    """How long the broker keeps what comes while nobody listens (MQTT 5; 3.1.1 leaves it to the
    broker)."""
    keepalive: Annotated[int, Ge(1), Le(3600)] = 15
    """Seconds of silence after which the line is tested; half as many more and it is down."""
    timeout: Duration = 10.0
    """Longest wait for the broker's answer to a connection."""
    user: str | None = None
    password_env: str | None = None
    """Environment variable that holds the password; it never stands in this file."""
    password_file: Annotated[str, Late()] | None = None
    """File that holds it."""
    tls: bool = False
    """Encrypt, and check the broker's certificate and name."""
    ca: Annotated[str, Late()] | None = None
    """File with the certificates that are trusted; absent: those of the system."""
    certificate: Annotated[str, Late()] | None = None
    """This end's own certificate, with its ``key``."""
    key: Annotated[str, Late()] | None = None
    will: str | None = None
    """Topic on which the broker says ``down`` when this end is gone, and this end ``up``."""
