"""Model files: the pressure of a pump or a fan by its speed and flow; a store of one's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files as resources

import numpy as np

from evertwin.signals import conversion, si_unit
from evertwin.starter.looks.seen import Seen
from evertwin.starter.numbers.starts import Own
from evertwin.starter.numbers.store_guess import Store
from evertwin.starter.proposal import Match


def pump_model(seen: Sequence[Seen], found: Sequence[Match]) -> str:
    """The file's text, with the usual largest speed, flow and pressure [SI] as its scale."""
    template = _template("pump.py.txt")
    for match in found:
        values = np.abs(seen[match.source].values(match.column))
        usual = float(np.nanquantile(values, 0.95)) * conversion(match.unit)[0]
        template = template.replace(f"<{match.channel}>", f"{usual or 1.0:.3g}")
        template = template.replace(f"<{match.channel} unit>", si_unit(match.unit))
    return template


def own_model(found: Sequence[Match], start: Own) -> str:
    """The file's text, in the SI units of what drives and what answers; 1 where nobody says."""
    units = {match.channel: si_unit(match.unit) for match in found}
    u, y = (units.get(name, "1") for name in ("u", "y"))
    per = f"({u})" if set(u) & set("/* ") else u
    per_time = "s" if isinstance(start, Store) else "s^2"
    text = _template(f"{type(start).__name__.lower()}.py.txt")
    text = text.replace("<u>", u).replace("<y>", y).replace("<speed>", f"{y}/s")
    cube = "1" if y == "1" else f"({y})^2"
    said = {
        "gain": y if u == "1" else f"{y}/{per}", "constant": y,
        "hardening": "1" if y == "1" else f"1/{cube}",
    }  # fmt: skip
    for name, unit in said.items():
        text = text.replace(f"<{name}>", f"{unit}/{per_time}")
    for name, value in start._asdict().items():
        most = 10.0 ** math.ceil(math.log10(max(abs(value), 1.0)) + 3)
        text = text.replace(f"<{name} start>", f"{value:.3g}")
        text = text.replace(f"<{name} least>", f"{value / 1000.0:.0e}")
        text = text.replace(f"<{name} most>", f"{most:.0e}")
        text = text.replace(f"<{name} kept>", "" if value else ", editable=False")
    return text


def _template(name: str) -> str:
    return resources("evertwin.starter").joinpath("templates", name).read_text("utf-8")
