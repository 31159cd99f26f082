"""Where slow work runs: in this process, or in processes of its own."""

from evertwin.engine.contract import Engine, Job
from evertwin.engine.in_process import InProcess
from evertwin.engine.pool import Pool
from evertwin.engine.spec import EngineSpec

__all__ = ["Engine", "EngineSpec", "InProcess", "Job", "Pool"]
