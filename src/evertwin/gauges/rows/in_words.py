"""Sizes and levels of channels in the unit that the twin file records them in."""

from __future__ import annotations

from evertwin.rows.channels import unit_told
from evertwin.setup.setup import Setup
from evertwin.signals import Channel
from evertwin.signals.spoken import suited
from evertwin.signals.units import conversion_of


def difference(setup: Setup, channel: Channel, value: float) -> str:
    """A difference [SI] with its sign: a degree has no zero."""
    unit, factor = suited(abs(value), channel.unit, unit_told(setup.spec, channel))
    return f"{value * factor:+.4g} {unit}".removesuffix(" 1")


def about(setup: Setup, channel: Channel, value: float, half: float) -> str:
    """A difference [SI], and how far it may be from that."""
    unit, factor = suited(abs(value), channel.unit, unit_told(setup.spec, channel))
    return f"{value * factor:+.3g} ± {half * factor:.2g} {unit}".removesuffix(" 1")


def level(setup: Setup, channel: Channel, value: float) -> str:
    """A value [SI] as it is recorded."""
    unit = unit_told(setup.spec, channel) or channel.unit
    factor, zero = conversion_of(unit)
    return f"{(value - zero) / factor:.4g} {unit}".removesuffix(" 1")
