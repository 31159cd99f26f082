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
from evertwin.types import Vector

STANDS, ENOUGH = 0.05, 20
"""Share of its usual speed below which a pump stands; rows of it that tell what rests on it."""
LEAST = 0.02
"""Share of the usual pressure below which nothing does."""


def pump_model(seen: Sequence[Seen], found: Sequence[Match]) -> str:
    """The file's text, with the usual largest speed, flow and pressure [SI] as its scale."""
    template, shares = _template("pump.py.txt"), dict[str, Vector]()
    for match in found:
        values = seen[match.source].values(match.column)
        usual = float(np.nanquantile(np.abs(values), 0.95)) or 1.0
        shares[match.channel] = values / usual
        scale = usual * conversion(match.unit)[0]
        template = template.replace(f"<{match.channel}>", f"{scale:.3g}")
        template = template.replace(f"<{match.channel} unit>", si_unit(match.unit))
    of_one = len({match.source for match in found}) == 1
    rest = resting(shares["speed"], shares["pressure"]) if of_one else 0.0
    template = template.replace("<rest kept>", "" if rest else ", editable=False")
    return template.replace("<rest>", f"{rest:.3g}")


def resting(speed: Vector, pressure: Vector) -> float:
    """The pressure that is left while a pump stands, as its usual one; 0: none, or it never stands.

    >>> speed = np.repeat([0.0, 1.0], 50)
    >>> resting(speed, 0.3 + 0.7 * speed), resting(speed, speed)
    (0.3, 0.0)
    """
    stands = pressure[(np.abs(speed) < STANDS) & np.isfinite(pressure)]
    rest = float(np.median(stands)) if len(stands) >= ENOUGH else 0.0
    return rest if rest > LEAST else 0.0


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
