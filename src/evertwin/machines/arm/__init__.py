"""The serial arm: description, rigid bodies, drives with friction, payload."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.machines.arm.model import Arm as Arm

__getattr__ = surface(__name__)
