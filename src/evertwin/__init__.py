"""evertwin keeps the model of a machine true to the machine.

    from evertwin import Twin
    result = Twin.open("robot.toml").run(["monday.csv"])

Names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

import importlib
import logging
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evertwin.config import TwinSpec
    from evertwin.errors import EvertwinError
    from evertwin.fold import Block, check_online, make_block
    from evertwin.loop.fitting import FitResult
    from evertwin.loop.result import RunResult
    from evertwin.machines.friction.check import check_friction
    from evertwin.models import (
        FunctionModel,
        Model,
        Parameter,
        Parameters,
        check_model,
    )
    from evertwin.signals import Channel, Layout
    from evertwin.sources import check_source
    from evertwin.store import check_store
    from evertwin.twin import Twin

__all__ = [
    "Block",
    "Channel",
    "EvertwinError",
    "FitResult",
    "FunctionModel",
    "Layout",
    "Model",
    "Parameter",
    "Parameters",
    "RunResult",
    "Twin",
    "TwinSpec",
    "check_friction",
    "check_model",
    "check_online",
    "check_source",
    "check_store",
    "make_block",
]

_ROOMS = {
    "Block": "fold",
    "Channel": "signals",
    "EvertwinError": "errors",
    "FitResult": "loop.fitting",
    "FunctionModel": "models",
    "Layout": "signals",
    "Model": "models",
    "Parameter": "models",
    "Parameters": "models",
    "RunResult": "loop.result",
    "Twin": "twin",
    "TwinSpec": "config",
    "check_friction": "machines.friction.check",
    "check_model": "models",
    "check_online": "fold",
    "check_source": "sources",
    "check_store": "store",
    "make_block": "fold",
}

logging.getLogger("evertwin").addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module 'evertwin' has no attribute {name!r}")
    return getattr(importlib.import_module(f"evertwin.{_ROOMS[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
