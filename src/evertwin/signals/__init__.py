"""Signals: units, channels and layouts; series, resampling and filters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.signals.channels import Channel, Layout, wrap
    from evertwin.signals.units import compatible, conversion, from_si, si_unit, to_si

__all__ = ["Channel", "Layout", "compatible", "conversion", "from_si", "si_unit", "to_si", "wrap"]

__getattr__ = surface(__name__)
