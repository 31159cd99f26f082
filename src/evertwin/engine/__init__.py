"""Where slow work runs: in this process, or in processes of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.engine.contract import Engine, Job
    from evertwin.engine.in_process import InProcess
    from evertwin.engine.pool import Pool
    from evertwin.engine.spec import EngineSpec

__all__ = ["Engine", "EngineSpec", "InProcess", "Job", "Pool"]

__getattr__ = surface(__name__)
