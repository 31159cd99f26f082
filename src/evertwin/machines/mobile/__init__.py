"""Mobile bases: a robot on a line, differential, omnidirectional, steered, and an odometer.

All are naive on purpose: the drive is taken to follow its command at once and in proportion. What
a real drive does besides (start threshold, saturation, lag, slip in turns) is what a twin learns.

Speeds are positive forwards and to the left, turn rates and headings counter-clockwise.
Reference: Siegwart, Nourbakhsh, Scaramuzza, "Introduction to Autonomous Mobile Robots", chapter 3.

>>> from evertwin.machines.mobile import Differential
>>> import numpy as np
>>> base = Differential()
>>> p = base.parameters.values
>>> turn = np.tile([1.0, np.pi / 2], (100, 1))        # a quarter of a circle to the left
>>> _, y = base.simulate(base.initial(p), turn, np.full(100, 0.01), p)
>>> y[-1].round(3).tolist()
[0.637, 0.637, 1.571]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.machines.mobile.bases import (
        Bicycle as Bicycle,
        Differential as Differential,
        Odometer as Odometer,
        Omni as Omni,
        Robot1D as Robot1D,
    )

__getattr__ = surface(__name__)
