"""Headings that give their unit behind a slash, as science writes it: ``T/K``, ``flow/(l/min)``.

A slash may part anything else: ``m/s`` alone is a unit, ``speed km/h`` ends in one, ``sensor/A``
counts sensors. So a letter alone has to be the symbol of what the unit measures, a unit of one
letter or of time stands behind a word that says so, and the rest has to be a unit at all.

>>> slashed("flow/(l/min)"), slashed("T_in / °C"), slashed("t/s"), slashed("p/bar")
(('flow', 'l/min'), ('T_in', '°C'), ('t', 's'), ('p', 'bar'))
>>> [slashed(name) for name in ("m/s", "km/h", "speed km/h", "sensor/A", "N/mm", "I/O", "ticks/s")]
[None, None, None, None, None, None, None]
>>> slashed("J1_acc_deg/s2"), slashed("flow_in/(l/min)")
(None, ('flow_in', 'l/min'))
"""

from __future__ import annotations

import re

from evertwin.errors import UsageError
from evertwin.signals.units import compatible, conversion, powers

_SLASH = re.compile(r"([^/()\[\]]*[^/()\[\]\s])\s*/\s*(?:\(\s*([^()]*?)\s*\)|(\S+))")
_SYMBOL = re.compile(r"(\w)(?:[_ ]\w+|\d+)?")
_SYMBOLS = {
    "t": ("s",), "T": ("K", "s"), "p": ("Pa",), "U": ("V",), "u": ("V",), "I": ("A",), "i": ("A",),
    "F": ("N",), "P": ("W",), "M": ("Nm",), "v": ("m/s",), "n": ("1/s", "rad/s"), "f": ("Hz",),
    "Q": ("m^3/s", "kg/s", "W", "J"), "m": ("kg",), "a": ("m/s^2",), "V": ("m^3", "V"),
    **dict.fromkeys("sxyzhldr", ("m",)), "R": ("ohm",), "E": ("J",), "q": ("rad", "m"),
}  # fmt: skip
"""Letter → what it stands for in a formula."""
_WORDS = {
    "s": "time zeit temps tiempo tempo elapsed uptime duration period delay timestamp",
    "A": "current strom courant corriente corrente cur", "N": "force kraft fuerza forza",
    "V": "voltage spannung tension voltaje tensione volt", "W": "power leistung puissance potencia",
    "K": "temperature temperatur temp temperatura", "J": "energy energie energia work",
    "m": "position distance weg way level height length x y z",
}  # fmt: skip
"""Unit → words that it stands behind."""


def slashed(heading: str) -> tuple[str, str] | None:
    """Name and unit; None where the slash parts something else."""
    found = _SLASH.fullmatch(heading.strip())
    if found is None:
        return None
    name, unit = found[1].strip(), (found[2] or found[3] or "").strip()
    if not re.search(r"[^\W\d_]", name) or not _is_unit(unit):
        return None
    symbol = _SYMBOL.fullmatch(name)
    if symbol is not None and (len(name) == 1 or symbol[1] in _SYMBOLS):
        fits = any(compatible(unit, kind) for kind in _SYMBOLS.get(symbol[1], ()))
        return (name, unit) if fits else None
    kind = next((one for one in _WORDS if (len(unit) == 1 or one == "s") and _same(unit, one)), "")
    said = re.findall(r"[a-z]+", name.lower())
    if kind and not any(word in said for word in _WORDS[kind].split()):
        return None
    last = re.split(r"[\s_]" if f"/{found[3]}" in heading else r"\s", name)[-1]
    parts = bool(kind) or not _is_unit(last)
    return (name, unit) if parts and (kind or len(unit) > 1 or unit in "%°") else None


def _same(unit: str, kind: str) -> bool:
    return unit not in ("%", "1") and compatible(unit, kind)


def _is_unit(text: str) -> bool:
    """A unit that measures something, or a share."""
    try:
        conversion(text)
        return text in ("%", "°") or bool(powers(text))
    except UsageError:
        return False
