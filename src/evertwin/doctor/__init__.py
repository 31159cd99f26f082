"""The doctor: looks at a twin and its data before anything is tuned, one file for each look."""

from __future__ import annotations

from evertwin.doctor.diagnose import Diagnosis, diagnose
from evertwin.doctor.finding import Finding

__all__ = ["Diagnosis", "Finding", "diagnose"]
