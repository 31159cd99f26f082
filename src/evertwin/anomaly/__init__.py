"""Anomaly: is this deviation usual, and if not, have the parameters moved or is the form wrong?

`Cusum` (limits from false alarms per month), `SnrLimit` and `Drift` watch residuals, phase by
phase; `branch` reads a tuned window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.anomaly.calibration import Calibrated, Calibration, Calm, blank, calibrate
    from evertwin.anomaly.cusum import Cusum, CusumState
    from evertwin.anomaly.drift import Drift, DriftState
    from evertwin.anomaly.phases import Regimes, TaskSteps
    from evertwin.anomaly.residuals import Alarms, Residuals
    from evertwin.anomaly.snr import SnrLimit, SnrState
    from evertwin.anomaly.verdict import Rule, Verdict, branch, explained

__all__ = [
    "Alarms",
    "Calibrated",
    "Calibration",
    "Calm",
    "Cusum",
    "CusumState",
    "Drift",
    "DriftState",
    "Regimes",
    "Residuals",
    "Rule",
    "SnrLimit",
    "SnrState",
    "TaskSteps",
    "Verdict",
    "blank",
    "branch",
    "calibrate",
    "explained",
]

__getattr__ = surface(__name__)
