"""Trial: nothing reaches the live model untested.

`Trial` compares a challenger with the champion on unseen segments, `PROBATION` watches it after the
promotion, `Recovery` an earlier version for good, `admit` says what it must show before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.trial.admission import admit as admit
    from evertwin.trial.gate import (
        PROBATION as PROBATION,
        Check as Check,
        GateState as GateState,
        Trial as Trial,
    )
    from evertwin.trial.recovery import Recovery as Recovery

__getattr__ = surface(__name__)
