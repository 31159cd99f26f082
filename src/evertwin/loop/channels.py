"""Which recorded channel is which channel of the model, and how it comes onto a row."""

from __future__ import annotations

from collections.abc import Iterator

from evertwin.config.spec import TwinSpec
from evertwin.errors import ConfigError
from evertwin.models import Model
from evertwin.signals import Layout
from evertwin.signals.units import compatible


def is_measured(spec: TwinSpec, name: str) -> bool:
    """Is an output recorded? A virtual sensor is not."""
    rule = spec.signals.get(name)
    return rule is None or rule.measured


def is_held(spec: TwinSpec, name: str, dynamic: bool) -> bool:
    """Is an input a command, held from its stamp on? Usually that of a ``dynamic`` model is."""
    rule = spec.signals.get(name)
    return dynamic if rule is None or rule.hold is None else rule.hold


def recorded_as(spec: TwinSpec, name: str) -> str:
    """The recorded or derived channel that is a channel of the model."""
    rule = spec.signals.get(name)
    return name if rule is None or rule.source is None else rule.source


STEMS = (("q", "qd"), ("position", "speed"))
"""How positions and their speeds are called; a number may follow."""


def motions(spec: TwinSpec, layout: Layout) -> Iterator[tuple[int, int]]:
    """Columns of a position and of its speed, both recorded, neither derived."""
    derived = {one.name for one in spec.derive}
    for k, channel in enumerate(layout):
        for stem, rate in STEMS:
            end = channel.name.removeprefix(stem)
            name = rate + end
            if end == channel.name or (end and not end.isdigit()) or name not in layout.names:
                continue
            other = layout.channels[layout.names.index(name)]
            recorded = not derived & {recorded_as(spec, one.name) for one in (channel, other)}
            if recorded and compatible(f"({channel.unit})/s", other.unit):
                yield k, layout.names.index(name)


def check_units(spec: TwinSpec, model: Model) -> None:
    """Does each channel measure what the model takes or gives, and is the requirement one of what
    is watched? A pure number may be anything.

    Raises:
        ConfigError: names the channel and both units.
    """
    asked, watched = spec.anomaly.unit, spec.anomaly.outputs or model.outputs.names
    fit = [one.name for one in model.outputs if not asked or compatible(asked, one.unit)]
    for channel in model.outputs:
        if channel.name in set(watched) - set(fit) and channel.unit != "1":
            hint = f"[anomaly] outputs = {fit}" if fit else "a bare number is a share"
            raise ConfigError(
                f"[anomaly] requirement is in '{asked}', and output {channel.name!r} in "
                f"'{channel.unit}': correct its unit ({hint})"
            )
    derived = {one.name for one in spec.derive}
    for channel in (*model.inputs, *model.outputs):
        name = recorded_as(spec, channel.name)
        for source in spec.source:
            told = source.channels.get(name)
            # A scale may turn one quantity into another: a current into a torque.
            if told is None or name in derived or told.scale != 1.0:
                continue
            if compatible(told.unit, channel.unit) or "1" in (told.unit, channel.unit):
                continue
            raise ConfigError(
                f"source {source.name!r}: channel {name!r} is in '{told.unit}', and the model's "
                f"{channel.name!r} in '{channel.unit}': correct the unit in [source.channels], or "
                f"say [signals.{channel.name}] from = …"
            )
