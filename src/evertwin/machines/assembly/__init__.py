"""Machines put together from components: their ports, their joining, both causal readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.machines.assembly.forward import Forward as Forward
    from evertwin.machines.assembly.inverse import (
        Inverse as Inverse,
        StaticInverse as StaticInverse,
    )
    from evertwin.machines.assembly.model import assembly as assembly
    from evertwin.machines.assembly.parts import KINDS as KINDS
    from evertwin.machines.assembly.path import (
        Circle as Circle,
        Joints as Joints,
        Limits as Limits,
        Line as Line,
        Pause as Pause,
        moves_of as moves_of,
        plan as plan,
    )
    from evertwin.machines.assembly.sensors import sensors_of as sensors_of
    from evertwin.machines.assembly.train import join as join

__getattr__ = surface(__name__)
