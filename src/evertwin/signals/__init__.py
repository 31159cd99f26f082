"""Signals: units, channels and layouts; series, resampling and filters."""

from evertwin.signals.channels import Channel, Layout, wrap
from evertwin.signals.units import compatible, conversion, from_si, si_unit, to_si

__all__ = [
    "Channel",
    "Layout",
    "compatible",
    "conversion",
    "from_si",
    "si_unit",
    "to_si",
    "wrap",
]
