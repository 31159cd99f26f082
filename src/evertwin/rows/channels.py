"""Which recorded channel is which channel of the model, and how it comes onto a row."""

from __future__ import annotations

from collections.abc import Iterator

from evertwin.config import place
from evertwin.config.spec import TwinSpec
from evertwin.errors import ConfigError
from evertwin.models import Model
from evertwin.settings.notes import Path
from evertwin.settings.quantity import Measured, written
from evertwin.signals import Channel, Layout
from evertwin.signals.units import compatible, conversion_of, lacks_angle
from evertwin.sources.spec import ChannelSpec


def is_measured(spec: TwinSpec, name: str) -> bool:
    """Is an output recorded? A virtual sensor is not."""
    rule = spec.signals.get(name)
    return rule is None or rule.measured


def is_held(spec: TwinSpec, name: str, dynamic: bool) -> bool:
    """Is an input a command, held from its stamp on? Usually that of a ``dynamic`` model is."""
    rule = spec.signals.get(name)
    return dynamic if rule is None or rule.hold is None else rule.hold


def is_kept(spec: TwinSpec, name: str) -> bool:
    """Is an input held over empty cells too, because the twin file says that it is a command?"""
    rule = spec.signals.get(name)
    return rule is not None and rule.hold is True


def recorded_as(spec: TwinSpec, name: str) -> str:
    """The recorded or derived channel that is a channel of the model."""
    rule = spec.signals.get(name)
    return name if rule is None or rule.source is None else rule.source


LINEAR = {"filter", "derivative", "slope", "middle", "mean", "scale", "unwrap"}
"""What is computed of one channel, and is so many times as large where that is."""


def measured_as(spec: TwinSpec, name: str) -> str:
    """The recorded channel that a channel of the model is proportional to: itself, or what it is
    derived from.

    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.sync.spec import DeriveSpec
    >>> v = DeriveSpec(name="v", op="derivative", source=("x",))
    >>> measured_as(TwinSpec("cart", ModelSpec("robot1d"), derive=(v,)), "v")
    'x'
    """
    made = {one.name: one for one in spec.derive}
    found = recorded_as(spec, name)
    while (one := made.get(found)) and one.op in LINEAR and len(one.source) == 1:
        found = one.source[0]
        del made[one.name]  # a channel may be filtered under its own name
    return found


def averaged(spec: TwinSpec, name: str) -> tuple[str, ...]:
    """The channels of which a channel of the model is the mean; empty: it is none of several.

    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.sync.spec import DeriveSpec
    >>> box = DeriveSpec(name="box", op="mean", source=("a", "b"))
    >>> averaged(TwinSpec("oven", ModelSpec("thermal"), derive=(box,)), "box")
    ('a', 'b')
    """
    found = recorded_as(spec, name)
    means = [one.source for one in spec.derive if one.name == found and one.op == "mean"]
    return means[-1] if means and len(means[-1]) > 1 else ()


SAME = {"filter", "middle", "mean", "unwrap"}
"""What is computed in the unit of what it is computed of."""


def unit_recorded(spec: TwinSpec, name: str) -> str:
    """The unit in which the twin file says that a channel of the model is recorded, directly or as
    what it is computed of; empty where nobody says so.

    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.sources.spec import SourceSpec
    >>> from evertwin.sync.spec import DeriveSpec
    >>> logger = SourceSpec("logger", channels={n: ChannelSpec(n, unit="degC") for n in ("a", "b")})
    >>> box = DeriveSpec(name="box", op="mean", source=("a", "b"))
    >>> oven = TwinSpec("oven", ModelSpec("thermal"), source=(logger,), derive=(box,))
    >>> unit_recorded(oven, "box")
    'degC'
    """
    told = {n: c.unit for source in spec.source for n, c in source.channels.items()}
    made = {one.name: one for one in spec.derive}
    names, left = {recorded_as(spec, name)}, set(made)
    while todo := [n for n in names & left if made[n].op in SAME]:
        left -= set(todo)  # a channel may be filtered under its own name
        names = (names - set(todo)).union(*(made[n].source for n in todo))
    units = {"" if n in left else told.get(n, "") for n in names}
    return units.pop() if len(units) == 1 else ""


def unit_told(spec: TwinSpec, channel: Channel) -> str:
    """The unit that people are told a channel in: that of the recording, else of the model."""
    return unit_recorded(spec, channel.name) or channel.stated


def size_recorded(spec: TwinSpec, name: str) -> float:
    """What 1 in the recording of a channel of the model is [SI], by its unit and scale; 1 where
    the twin file says neither.

    >>> from evertwin.config.spec import ModelSpec
    >>> from evertwin.sources.spec import SourceSpec
    >>> drive = SourceSpec("drive", channels={"tau": ChannelSpec("current", unit="Nm", scale=1.6)})
    >>> size_recorded(TwinSpec("axis", ModelSpec("drive_force"), source=(drive,)), "tau")
    1.6
    """
    found = measured_as(spec, name)
    told = [source.channels[found] for source in spec.source if found in source.channels]
    return float(told[0].scale * conversion_of(told[0].unit)[0]) if told else 1.0


def measured(spec: TwinSpec, layout: Layout) -> dict[str, tuple[list[int], str]]:
    """Each recorded channel that channels of a layout are proportional to: their columns, and its
    unit."""
    units = {name: c.unit for source in spec.source for name, c in source.channels.items()}
    found = dict[str, tuple[list[int], str]]()
    for k, channel in enumerate(layout):
        name, unit = measured_as(spec, channel.name), channel.unit
        if name == recorded_as(spec, channel.name) or name not in units:
            name = channel.name
        else:
            unit = units[name]
        found.setdefault(name, ([], unit))[0].append(k)
    return found


STEMS = (("q", "qd", "qdd"), ("position", "speed", "acceleration"))
"""How positions, their speeds and accelerations are called; a number may follow."""


def courses(layout: Layout) -> Iterator[tuple[int, ...]]:
    """Columns of a position, of its speed, and of its acceleration where there is one."""
    for k, channel in enumerate(layout):
        for stem, *rates in STEMS:
            end, found = channel.name.removeprefix(stem), [k]
            if end == channel.name or (end and not end.isdigit()):
                continue
            for rate in rates:
                name, unit = rate + end, layout.units[found[-1]]
                if name not in layout.names:
                    break
                if not compatible(f"({unit})/s", layout.units[layout.names.index(name)]):
                    break
                found.append(layout.names.index(name))
            if len(found) > 1:
                yield tuple(found)


def motions(spec: TwinSpec, layout: Layout) -> Iterator[tuple[int, int]]:
    """Columns of a position and of its speed, both recorded, neither derived."""
    derived = {one.name for one in spec.derive}
    for position, speed, *_ in courses(layout):
        if not derived & {recorded_as(spec, layout.names[k]) for k in (position, speed)}:
            yield position, speed


def check_units(spec: TwinSpec, model: Model) -> None:
    """Does each channel measure what the model takes or gives, and is the requirement one of what
    is watched? A pure number may be anything; a length asked of a pose is asked of its heading as
    the way of a point 1 m ahead, so that 0.01 m is 0.01 rad.

    Raises:
        ConfigError: names the channel and both units.
    """
    asked, watched = spec.anomaly.unit, spec.anomaly.outputs or model.outputs.names
    fit = [one.name for one in model.outputs if not asked or compatible(asked, one.unit)]
    if asked and compatible(asked, "m"):
        posed = {one.group for one in model.outputs if one.name in fit}
        fit += [c.name for c in model.outputs if c.kind == "angle" and c.group in posed]
    for channel in model.outputs:
        if channel.name in set(watched) - set(fit) and channel.unit != "1":
            hint = f"[anomaly] outputs = {fit}" if fit else "a bare number is a share"
            raise ConfigError(
                f"{place(spec, ('anomaly', 'requirement'))}: requirement is in '{asked}', and "
                f"output {channel.name!r} in '{channel.unit}': correct its unit ({hint})"
            )
    derived = {one.name for one in spec.derive}
    for channel in (*model.inputs, *model.outputs):
        name = recorded_as(spec, channel.name)
        for k, source in enumerate(spec.source):
            told = source.channels.get(name)
            if told is None or name in derived:
                continue
            step = _step(told, channel)
            if step:
                where = place(spec, ("source", k, "channels", name, "unit"))
                raise ConfigError(
                    f"{where}: source {source.name!r}: channel {name!r} is in '{told.unit}', and "
                    f"the model's {channel.name!r} in '{channel.stated or channel.unit}': {step}"
                )


def _step(told: ChannelSpec, channel: Channel) -> str:
    """What to do about a channel in another quantity's unit; nothing where it is in its own."""
    if lacks_angle(told.unit, channel.unit):
        per = told.unit[1:] if told.unit.startswith("1/") else f"*({told.unit})"
        return f"it may count turns or radians: write 'turn{per}' (rpm is turn/min) or 'rad{per}'"
    unit = channel.stated or channel.unit
    if lacks_angle(channel.stated or "1", told.unit):
        return "the model may count turns or radians: state 'rpm' or 'rad/s' in it"
    plain = not channel.stated and "1" in (told.unit, channel.unit)
    if plain or compatible(told.unit, channel.unit):
        return ""
    if told.scale == 1.0:
        return f"correct the unit, or say [signals.{channel.name}] from = …"
    return (
        f"the unit is that of the file's value times scale: write unit = '{unit}', and as "
        f"scale how many {unit} one of the file's is"
    )


def check_quantities(spec: TwinSpec, model: Model) -> None:
    """Does each quantity that was written with a unit measure what the model says that it is?

    Raises:
        ConfigError: names file, key, the unit that is expected and what came.
    """
    for path, value, unit in _quantities(spec, model):
        if isinstance(value, Measured) and not compatible(written(value.written)[1], unit):
            said = "SI" if conversion_of(unit) == (1.0, 0.0) else f"in '{unit}'"
            expected = "a pure number" if unit == "1" else f"a quantity in '{unit}' or alike"
            raise ConfigError(
                f"{place(spec, path)}: expected {expected}, got '{value.written}': correct the "
                f"unit, or write a bare number, which is {said}"
            )


def _quantities(spec: TwinSpec, model: Model) -> Iterator[tuple[Path, object, str]]:
    """Each setting that is in the unit of a parameter or channel: where it stands, its value, the
    unit; names that the model does not have are told elsewhere."""
    for item in model.parameters:
        if said := spec.model.parameters.get(item.name):
            for key in ("value", "low", "high", "sigma"):
                path = ("model", "parameters", item.name, key)
                yield path, getattr(said, key), item.unit
    for channel in (*model.inputs, *model.outputs):
        if rule := spec.signals.get(channel.name):
            for key, per in (("low", False), ("high", False), ("rate", True)):
                unit = f"({channel.unit})/s" if per else channel.unit
                yield ("signals", channel.name, key), getattr(rule, key), unit
        linear = channel.kind == "linear"
        if linear and (group := spec.arbiter.groups.get(channel.group)):
            for key in ("tolerance", "sigma"):
                path = ("arbiter", "groups", channel.group, key)
                yield path, getattr(group, key), channel.unit
        if size := spec.prediction.scale.get(channel.name):
            yield ("prediction", "scale", channel.name), size, channel.unit
    if spec.moving is not None:
        for deciding in set(spec.moving.channels.values()) & set(model.inputs.names):
            unit = model.inputs.channels[model.inputs.index(deciding)].unit
            yield ("moving", "above"), spec.moving.above, unit
