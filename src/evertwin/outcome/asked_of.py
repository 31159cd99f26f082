"""What each output may be off by."""

from __future__ import annotations

import math
from collections.abc import Mapping

from evertwin.outcome.result import OutputFigures
from evertwin.setup.setup import Setup


def limits(setup: Setup, outputs: Mapping[str, OutputFigures]) -> dict[str, float]:
    """The largest deviation of each output that is judged, in its own unit; none where none is
    asked."""
    if not math.isfinite(setup.requirement):
        return {}
    return {
        name: setup.requirement * (one.size if setup.relative else 1.0)
        for k, (name, one) in enumerate(outputs.items()) if setup.watched[k]
    }  # fmt: skip
