"""MuJoCo models, MJCF or URDF: roll-outs and inverse dynamics. Needs the extra ``mujoco``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from evertwin.models.mujoco.inverse import InverseDynamics
from evertwin.models.mujoco.model import MuJoCo

__all__ = ["InverseDynamics", "MuJoCo", "model_of_file"]


def model_of_file(
    file: str | Path, inverse: bool = False, **options: Any
) -> MuJoCo | InverseDynamics:
    """What a twin file's ``kind = "mujoco"`` means: roll-outs, or with ``inverse`` torques."""
    return InverseDynamics.of(file, **options) if inverse else MuJoCo.of(file, **options)
