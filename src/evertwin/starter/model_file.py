"""Model files: the pressure of a pump or a fan by its speed and flow; a store of one's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files as resources

import numpy as np

from evertwin.signals import conversion, si_unit
from evertwin.starter.proposal import Match
from evertwin.starter.seen import Seen
from evertwin.starter.starts import store_of


def pump_model(seen: Sequence[Seen], found: Sequence[Match]) -> str:
    """The file's text, with the usual largest speed, flow and pressure [SI] as its scale."""
    template = _template("pump.py.txt")
    for match in found:
        values = np.abs(seen[match.source].values(match.column))
        usual = float(np.nanquantile(values, 0.95)) * conversion(match.unit)[0]
        template = template.replace(f"<{match.channel}>", f"{usual or 1.0:.3g}")
        template = template.replace(f"<{match.channel} unit>", si_unit(match.unit))
    return template


def own_model(seen: Sequence[Seen], found: Sequence[Match], period: float | None) -> str:
    """The file's text, in the SI units of what drives and what answers; 1 where nobody says. Rows
    without stamps are ``period`` [s] apart."""
    units = {match.channel: si_unit(match.unit) for match in found}
    u, y = (units.get(name, "1") for name in ("u", "y"))
    text = _template("model.py.txt").replace("<u>", u).replace("<y>", y)
    per = f"({u})" if set(u) & set("/* ") else u
    for name, unit in (("gain", y if u == "1" else f"{y}/{per}"), ("constant", y)):
        text = text.replace(f"<{name}>", f"{unit}/s")
    start = store_of(found, seen, period)
    for name, value in zip(start._fields, start, strict=True):
        most = 10.0 ** math.ceil(math.log10(max(abs(value), 1.0)) + 3)
        text = text.replace(f"<{name} start>", f"{value:.3g}")
        text = text.replace(f"<{name} most>", f"{most:.0e}")
    return text


def _template(name: str) -> str:
    return resources("evertwin.starter").joinpath("templates", name).read_text("utf-8")
