"""FMUs from elsewhere (FMI 2.0 and 3.0), in a process of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.models.fmu.faults import Fault
    from evertwin.models.fmu.model import Fmu, fmu
    from evertwin.models.fmu.options import Options

__all__ = ["Fault", "Fmu", "Options", "fmu"]

__getattr__ = surface(__name__)
