"""How a proof ends: what was asked of it, by name, in one line and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Mapping

import numpy as np

ASKED = {0.80: (0.75, 0.85), 0.95: (0.92, 0.98)}
"""Share of the truths that intervals must hold, by what they say."""
NO_DATA = 4
"""Exit code of a proof that needs EVERTWIN_DATA and has none."""


def chance(level: float, count: int) -> float:
    """How far off ``level`` the share of ``count`` independent cases may be, 95 %."""
    return float(1.96 * np.sqrt(level * (1.0 - level) / count))


def holds(level: float, share: float, error: float = 0.0) -> bool:
    """Is a share what its level says: within `ASKED`, or with few cases within ``error`` of it?"""
    low, high = ASKED[level]
    return bool(min(low, level - error) <= share <= max(high, level + error))


def ended(demands: Mapping[str, bool]) -> int:
    """Prints what was missed; exit code 0 if nothing was."""
    missed = [name for name, reached in demands.items() if not reached]
    sys.stdout.write(f"MISSED: {'; '.join(missed)}\n" if missed else "all reached\n")
    return 1 if missed else 0


def no_data() -> int:
    """Says that there is nothing to show."""
    sys.stdout.write("EVERTWIN_DATA is not set: expected the folder of real recordings\n")
    return NO_DATA
