"""Protocols by name: own ones, and what other packages add under ``evertwin.sources``.

>>> sorted(OWN), settings_of("replay").__name__
(['file', 'modbus', 'mqtt', 'opcua', 'replay', 'ros'], 'ReplaySettings')
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import entry_points
from pkgutil import resolve_name
from typing import Any

from pydantic import ValidationError

from evertwin.errors import ConfigError, UsageError, nearest
from evertwin.settings.decode import adapter
from evertwin.settings.notes import dotted
from evertwin.sources.live.contract import Around, LiveSettings, LiveSource
from evertwin.sources.spec import ArraySpec, SourceSpec

OWN = {
    "file": (
        "evertwin.sources.live.files.growing:GrowingSettings",
        "evertwin.sources.live.files.growing:Growing",
    ),
    "modbus": (
        "evertwin.sources.live.modbus.spec:ModbusSettings",
        "evertwin.sources.live.modbus.source:Modbus",
    ),
    "mqtt": (
        "evertwin.sources.live.mqtt.spec:MqttSettings",
        "evertwin.sources.live.mqtt.source:Mqtt",
    ),
    "opcua": (
        "evertwin.sources.live.opcua.spec:OpcuaSettings",
        "evertwin.sources.live.opcua.source:Opcua",
    ),
    "replay": (
        "evertwin.sources.live.files.replay:ReplaySettings",
        "evertwin.sources.live.files.replay:Replay",
    ),
    "ros": (
        "evertwin.sources.live.ros.spec:RosSettings",
        "evertwin.sources.live.ros.source:Ros",
    ),
}
"""Protocol → where its settings and its source are; the libraries load with the source."""


def settings_of(protocol: str) -> type[LiveSettings]:
    """The section that a ``[[twin.source]]`` of this protocol is read as.

    Raises:
        UsageError: there is no such protocol.
    """
    found: type[LiveSettings]
    if protocol in OWN:
        found = resolve_name(OWN[protocol][0])
    else:
        found = _plugin(protocol).settings
    return found


def read_settings(table: Mapping[str, Any], name: str = "source") -> LiveSettings:
    """The section that a table says.

    Raises:
        ConfigError: it does not say what it must; ``name`` stands in the message.

    >>> read_settings({"source": "log", "protocol": "replay", "speed": 2}).speed
    2.0
    """
    try:
        return adapter(settings_of(str(table.get("protocol")))).validate_python(table)
    except ValidationError as error:
        said = (f"{dotted(one['loc'])}: {one['msg']}" for one in error.errors(include_url=False))
        raise ConfigError(f"{name}: {'; '.join(said)}") from None


def open_live(
    settings: LiveSettings | Mapping[str, Any],
    spec: SourceSpec | ArraySpec,
    around: Around | None = None,
) -> LiveSource:
    """The source of a protocol; nothing is connected yet.

    Args:
        settings: of the ``[[twin.source]]``; as a table too.
        spec: the ``[[source]]`` or ``[[array]]`` of the twin file with its name.
        around: what the sources of this twin share; make one a twin.

    Raises:
        UsageError: there is no such protocol, or its settings and the twin file do not fit.
        MissingExtra: its library is not installed.
    """
    if isinstance(settings, Mapping):
        settings = read_settings(settings)
    protocol = settings.protocol
    make = resolve_name(OWN[protocol][1]) if protocol in OWN else _plugin(protocol)
    if isinstance(spec, ArraySpec) and not getattr(make, "arrays", False):
        raise UsageError(
            f"array {spec.name!r}: {protocol} gives no arrays; mqtt and ros do, or a source "
            "of your own that says so (arrays = True)"
        )
    source: LiveSource = make(settings, spec, Around() if around is None else around)
    return source


def _plugin(protocol: str) -> Any:
    points = {point.name: point for point in entry_points(group="evertwin.sources")}
    found = points[protocol].load() if protocol in points else None
    if not hasattr(found, "settings"):
        raise UsageError(f"protocol {protocol!r} is not known; {nearest(protocol, OWN)}")
    return found
