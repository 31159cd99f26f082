"""Sensors told from the machine over a window of rows: unit, sign, offset, silence, noise."""

from __future__ import annotations
