"""evertwin keeps the model of a machine true to the machine.

    from evertwin import Twin
    result = Twin.open("robot.toml").run(["monday.csv"])

Names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.config import TwinSpec
    from evertwin.errors import EvertwinError
    from evertwin.fold import Block, check_online, make_block
    from evertwin.loop.fitting import FitResult
    from evertwin.loop.result import RunResult
    from evertwin.machines.friction.check import check_friction
    from evertwin.models import FunctionModel, Model, Parameter, Parameters, check_model
    from evertwin.models.terms.check import check_term
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
    "check_term",
    "make_block",
]

__getattr__ = surface(__name__)

logging.getLogger("evertwin").addHandler(logging.NullHandler())


def __dir__() -> list[str]:
    return sorted(__all__)
