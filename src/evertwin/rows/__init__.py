"""Rows of a twin: recordings and live chunks checked, cut, and put on one clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.rows.channels import check_units as check_units
    from evertwin.rows.feed import Data as Data, Feed as Feed
    from evertwin.rows.samples import Numbered as Numbered

__getattr__ = surface(__name__)
