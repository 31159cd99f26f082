"""The doctor: looks at a twin and its data before anything is tuned, one file for each look."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.doctor.diagnosis import Diagnosis, diagnose
    from evertwin.doctor.finding import Finding

__all__ = ["Diagnosis", "Finding", "diagnose"]

__getattr__ = surface(__name__)
