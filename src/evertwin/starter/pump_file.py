"""A model file for a pump or a fan: the pressure of its speed and flow."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files as resources

import numpy as np

from evertwin.signals import conversion, si_unit
from evertwin.starter.proposal import Match
from evertwin.starter.seen import Seen


def pump_model(seen: Sequence[Seen], found: Sequence[Match]) -> str:
    """The file's text, with the usual largest speed, flow and pressure [SI] as its scale."""
    template = resources("evertwin.starter").joinpath("templates", "pump.py.txt").read_text("utf-8")
    for match in found:
        values = np.abs(seen[match.source].values(match.column))
        usual = float(np.nanquantile(values, 0.95)) * conversion(match.unit)[0]
        template = template.replace(f"<{match.channel}>", f"{usual or 1.0:.3g}")
        template = template.replace(f"<{match.channel} unit>", si_unit(match.unit))
    return template
