"""Settings of slow work: in how many processes it runs, and what one piece of it may take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from evertwin.settings.notes import Quantity
from evertwin.settings.section import Section


@dataclass(frozen=True)
class EngineSpec(Section):
    """``[engine]``: where slow work (fits, searches for corrections) runs.

    >>> EngineSpec().workers
    0
    """

    workers: Annotated[int, Ge(0), Le(64)] = 0
    """Processes for slow work, beside the one that follows the machine; 0: it does both."""
    time: Annotated[float, Quantity("s", difference=True), Gt(0.0), Le(604_800.0)] = 600.0
    """With workers: time that one piece of work may take; then it is given up."""
    memory: Annotated[float, Ge(0.1), Le(1024.0)] = 4.0
    """With workers: memory that one piece of work may take [GB]."""
