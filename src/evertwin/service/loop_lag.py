"""How late the event loop is: a sleep that wakes up later than it should was kept waiting.

>>> lag = Lag()
>>> lag.late.extend([0.001, 0.002, 0.2])
>>> lag.worst, lag.share(0.5)
(0.2, 0.002)
"""

from __future__ import annotations

import asyncio
import time
from collections import deque

import numpy as np

EVERY = 0.02


class Lag:
    """Watches the loop. See the module for an example."""

    def __init__(self) -> None:
        self.late: deque[float] = deque(maxlen=3000)
        """Of the newest minute [s]."""

    async def watch(self) -> None:
        """Until it is cancelled."""
        while True:
            due = time.perf_counter() + EVERY
            await asyncio.sleep(EVERY)
            self.late.append(max(time.perf_counter() - due, 0.0))

    @property
    def worst(self) -> float:
        """Of the newest minute."""
        return max(self.late, default=0.0)

    def share(self, quantile: float) -> float:
        """A quantile of the newest minute."""
        return float(np.quantile(self.late, quantile)) if self.late else 0.0
