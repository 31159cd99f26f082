"""The serial arm: description, rigid bodies, drives with friction, payload."""

from evertwin.machines.arm.model import Arm

__all__ = ["Arm"]
