"""The doctor: looks at a twin and its data before anything is tuned, one file for each look."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.doctor.diagnosis import Diagnosis as Diagnosis, diagnose as diagnose
    from evertwin.doctor.finding import Finding as Finding

__getattr__ = surface(__name__)
