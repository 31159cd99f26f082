"""Every picture and page of what the other rooms found."""

from evertwin.report.run_pictures import draw_run

__all__ = ["draw_run"]
