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
    from evertwin.config import TwinSpec as TwinSpec
    from evertwin.errors import EvertwinError as EvertwinError
    from evertwin.fold import Block as Block, check_online as check_online, make_block as make_block
    from evertwin.machines.friction.check import check_friction as check_friction
    from evertwin.models import (
        FunctionModel as FunctionModel,
        Model as Model,
        Parameter as Parameter,
        Parameters as Parameters,
        check_model as check_model,
    )
    from evertwin.models.checks.term import check_term as check_term
    from evertwin.outcome.result import RunResult as RunResult
    from evertwin.refit.recordings.fitting import FitResult as FitResult
    from evertwin.signals import Channel as Channel, Layout as Layout
    from evertwin.sources import check_source as check_source
    from evertwin.sources.live import check_live as check_live, open_live as open_live
    from evertwin.store import check_owners as check_owners, check_store as check_store
    from evertwin.twin import Twin as Twin

__getattr__ = surface(__name__)

logging.getLogger("evertwin").addHandler(logging.NullHandler())


def __dir__() -> list[str]:
    names: list[str] = __getattr__("__all__")
    return names
