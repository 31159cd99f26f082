"""A MuJoCo model as a twin file names it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from evertwin.errors import UsageError
from evertwin.models.mujoco.inverse import InverseDynamics
from evertwin.models.mujoco.model import MuJoCo


def model_of_file(
    file: str | Path = "", inverse: bool = False, text: str = "", **options: Any
) -> MuJoCo | InverseDynamics:
    """What a twin file's ``kind = "mujoco"`` means: roll-outs, or with ``inverse`` torques.

    Raises:
        UsageError: neither ``file`` nor ``text`` (XML at hand), or both.
    """
    if bool(file) == bool(text):
        raise UsageError("mujoco: expected the option 'file' (MJCF or URDF), or 'text' (XML)")
    kind = InverseDynamics if inverse else MuJoCo
    return kind.of(file, **options) if file else kind.from_text(text, **options)
