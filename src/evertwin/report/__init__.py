"""Every picture and page of what the other rooms found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.report.run_pictures import draw_run as draw_run

__getattr__ = surface(__name__)
