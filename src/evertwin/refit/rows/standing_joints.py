"""Bodies behind a joint that stands all the while: they are one with the link before it.

Whatever they are, the body before takes up what they do to other joints, and the torque that holds
them counts in no row. So they stay as described: a fit would share them out by noise.
"""

from __future__ import annotations

from evertwin.fold import Windows
from evertwin.machines.arm import Arm
from evertwin.models import Model


def without_standing(model: Model, names: tuple[str, ...], windows: Windows) -> tuple[str, ...]:
    """The names without bodies whose own joint stands, as `evertwin.setup.at_rest` told."""
    if not isinstance(model, Arm) or model.coupling is not None or not windows:
        return names
    speeds = (model.inputs.names.index(f"qd{j + 1}") for j in range(model.chain.n))
    still = {
        link
        for link, speed in zip(model.chain.links, speeds, strict=True)
        if not any(window.u[:, speed].any() for window in windows)
    }
    return tuple(name for name in names if name.partition(".")[0] not in still)
