"""A scan that comes again, number by number: does the machine stand, or is the lidar frozen?

A lidar has noise, so that none of its scans comes again while it works. One without noise, as in a
simulation, repeats its scan while the machine stands. So a scan that comes again while the inputs
drive is none; where scans came again while they did not, or where no input says whether it drives,
only after a few.

>>> after = Repeats.none(1).driven(0, 10, np.array([0.2])).after(True, before=20, t=30)
>>> after.frozen, after.drove, after.driven(0, 35, np.zeros(1)).after(True, 40, 50).frozen
(True, True, False)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.features.scans.scan_matcher import STANDING
from evertwin.features.scans.words import NEVER
from evertwin.types import Int64, Vector

DRIVES = 1e-3
"""Speed from which on an input drives [m/s, rad/s]."""
SINCE, UNTIL = 0, 1


class Repeats(NamedTuple):
    """How often the newest scan has come. See the module for an example."""

    inputs: Int64[np.ndarray, "sources two"]
    """Of each source of inputs: since when it drives, and until when it did [ns]."""
    drove: bool = False
    """Did an input drive the machine from the scan before to the newest one?"""
    again: int = 0
    """Times that it came again, since the machine may have driven."""
    since: int = NEVER
    """Stamp of the scan that came again [ns]."""
    noiseless: bool = False
    """Did the last scans that came while the machine stood repeat each other?"""

    @classmethod
    def none(cls, sources: int) -> Repeats:
        """Nothing was said, nothing seen."""
        return cls(np.tile(np.array([-NEVER, NEVER]), (sources, 1)))

    def driven(self, source: int, t: int, v: Vector) -> Repeats:
        """What inputs of one source say [m/s, rad/s]. Consumes ``self``."""
        mine, drives = self.inputs[source], bool(np.nanmax(np.abs(v), initial=0.0) > DRIVES)
        if drives and mine[SINCE] == -NEVER:
            mine[SINCE] = t
        elif not drives and mine[SINCE] != -NEVER:
            mine[:] = -NEVER, t
        return self

    def after(self, same: bool, before: int, t: int) -> Repeats:
        """With a scan more at ``t``, the ``same`` as the one at ``before``."""
        drove = bool(((self.inputs[:, SINCE] < t) | (self.inputs[:, UNTIL] > before)).any())
        stood = len(self.inputs) > 0 and not drove
        again = self.again + 1 if same and not (stood and self.again == 0) else 0
        return self._replace(
            drove=drove, again=again, since=self.since if self.again else before,
            noiseless=same if stood else self.noiseless,
        )  # fmt: skip

    @property
    def frozen(self) -> bool:
        """Is the newest scan no measurement?"""
        sure = self.drove and not self.noiseless
        return self.again >= (1 if sure else STANDING)

    @property
    def said(self) -> str:
        """What is wrong, and what to do."""
        what = "the same ranges came again and again, number by number"
        stands = "the machine stands, and its scans have no noise"
        if self.drove:
            what += f", while the inputs drive: the lidar or its driver is frozen (or {stands})"
        else:
            what += f": the lidar or its driver is frozen, or {stands}"
        return f"{what}; no pose is made of them: look after the lidar, or start its driver anew"
