"""Machines put together from components: their ports, their joining, both causal readings."""

from evertwin.machines.assembly.path import (
    Circle,
    Joints,
    Limits,
    Line,
    Motion,
    Move,
    Pause,
    moves_of,
    plan,
)

__all__ = ["Circle", "Joints", "Limits", "Line", "Motion", "Move", "Pause", "moves_of", "plan"]
