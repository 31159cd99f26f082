"""The twin: assembly, driver, results. The only room that knows every stage."""

from evertwin.twin.fitting import FitResult
from evertwin.twin.result import RunResult
from evertwin.twin.twin import Twin

__all__ = ["FitResult", "RunResult", "Twin"]
