"""Signals: units, channels and layouts; series, resampling and filters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.signals.channels import (
        Channel as Channel,
        Layout as Layout,
        unwrapped as unwrapped,
        wrap as wrap,
    )
    from evertwin.signals.units import (
        compatible as compatible,
        conversion as conversion,
        from_si as from_si,
        lacks_angle as lacks_angle,
        si_unit as si_unit,
        to_si as to_si,
    )

__getattr__ = surface(__name__)
