"""Where slow work runs: in this process, or in processes of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.engine.contract import Engine as Engine, Job as Job
    from evertwin.engine.in_process import InProcess as InProcess
    from evertwin.engine.pool import Pool as Pool
    from evertwin.engine.spec import EngineSpec as EngineSpec

__getattr__ = surface(__name__)
