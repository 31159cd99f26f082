"""MuJoCo models, MJCF or URDF: roll-outs and inverse dynamics. Needs the extra ``mujoco``."""

from evertwin.models.mujoco.model import model_of_file
from evertwin.models.mujoco.model import InverseDynamics
from evertwin.models.mujoco.model import MuJoCo

__all__ = ["InverseDynamics", "MuJoCo", "model_of_file"]
