"""Machines put together from components: their ports, their joining, both causal readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.machines.assembly.forward import Forward
    from evertwin.machines.assembly.inverse import Inverse, StaticInverse
    from evertwin.machines.assembly.model import assembly
    from evertwin.machines.assembly.parts import KINDS
    from evertwin.machines.assembly.path import (
        Circle,
        Joints,
        Limits,
        Line,
        Pause,
        moves_of,
        plan,
    )
    from evertwin.machines.assembly.sensors import sensors_of
    from evertwin.machines.assembly.train import join

__all__ = [
    "KINDS",
    "Circle",
    "Forward",
    "Inverse",
    "Joints",
    "Limits",
    "Line",
    "Pause",
    "StaticInverse",
    "assembly",
    "join",
    "moves_of",
    "plan",
    "sensors_of",
]

__getattr__ = surface(__name__)
