"""Publishers by protocol; their libraries load when they are opened.

>>> sorted(OWN), settings_of("mqtt").__name__
(['mqtt', 'opcua', 'ros'], 'MqttOutSettings')
"""

from __future__ import annotations

from pkgutil import resolve_name

from evertwin.errors import UsageError, nearest
from evertwin.publishers.contract import About, Ask, Publisher, PublisherSettings

OWN = {
    "mqtt": ("evertwin.publishers.mqtt_spec:MqttOutSettings", "evertwin.publishers.mqtt:MqttOut"),
    "opcua": (
        "evertwin.publishers.opcua_spec:OpcuaOutSettings",
        "evertwin.publishers.opcua:OpcuaOut",
    ),
    "ros": ("evertwin.publishers.ros_spec:RosOutSettings", "evertwin.publishers.ros:RosOut"),
}
"""Protocol → where its settings and its publisher are."""


def settings_of(protocol: str) -> type[PublisherSettings]:
    """The section that a ``[[twin.publisher]]`` of this protocol is read as.

    Raises:
        UsageError: there is no such protocol.
    """
    if protocol not in OWN:
        raise UsageError(f"protocol {protocol!r} is not known; {nearest(protocol, OWN)}")
    found: type[PublisherSettings] = resolve_name(OWN[protocol][0])
    return found


def open_publisher(settings: PublisherSettings, about: About, ask: Ask) -> Publisher:
    """The publisher of a protocol; nothing is connected yet.

    Args:
        settings: of the ``[[twin.publisher]]``.
        about: the twin that it speaks for.
        ask: answers questions.
    """
    publisher: Publisher = resolve_name(OWN[settings.protocol][1])(settings, about, ask)
    return publisher
