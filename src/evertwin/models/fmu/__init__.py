"""FMUs from elsewhere (FMI 2.0 and 3.0), in a process of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.models.fmu.faults import Fault as Fault
    from evertwin.models.fmu.model import Fmu as Fmu, fmu as fmu
    from evertwin.models.fmu.options import Options as Options

__getattr__ = surface(__name__)
