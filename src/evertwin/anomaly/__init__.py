"""Anomaly: is this deviation usual, and if not, have the parameters moved or is the form wrong?

`Cusum` (limits from false alarms per month), `SnrLimit` and `Drift` watch residuals, phase by
phase; `branch` reads a tuned window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.anomaly.calibration import (
        Calibrated as Calibrated,
        Calibration as Calibration,
        Calm as Calm,
        blank as blank,
        calibrate as calibrate,
    )
    from evertwin.anomaly.cusum import Cusum as Cusum, CusumState as CusumState
    from evertwin.anomaly.drift import Drift as Drift, DriftState as DriftState
    from evertwin.anomaly.external import (
        Contact as Contact,
        External as External,
        ExternalState as ExternalState,
        Seen as Seen,
        Told as Told,
    )
    from evertwin.anomaly.kinematics import (
        Contradiction as Contradiction,
        Kinematics as Kinematics,
        KinematicsState as KinematicsState,
    )
    from evertwin.anomaly.level import Level as Level, Rise as Rise
    from evertwin.anomaly.phases import Regimes as Regimes, TaskSteps as TaskSteps
    from evertwin.anomaly.recurrence import (
        Place as Place,
        Recurrence as Recurrence,
        RecurrenceState as RecurrenceState,
    )
    from evertwin.anomaly.residuals import Alarms as Alarms, Residuals as Residuals
    from evertwin.anomaly.snr import SnrLimit as SnrLimit, SnrState as SnrState
    from evertwin.anomaly.still import Still as Still, StillState as StillState
    from evertwin.anomaly.verdict import (
        Rule as Rule,
        Verdict as Verdict,
        branch as branch,
        explained as explained,
    )

__getattr__ = surface(__name__)
