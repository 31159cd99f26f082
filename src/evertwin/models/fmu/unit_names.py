"""Units as FMI and Modelica write them, in the spelling of `evertwin.signals`.

>>> spelled("N.m.s/rad"), spelled("kg.m2"), spelled("J/(kg.K)"), spelled("m/s2"), spelled("")
('Nms/rad', 'kgm2', 'J/(kg*K)', 'm/s**2', '1')
"""

from __future__ import annotations

import re

_READABLE = {"N.m": "Nm", "N.m.s/rad": "Nms/rad", "kg.m2": "kgm2", "N.s/m": "Ns/m", "N.m/A": "Nm/A"}
_SYMBOLS = {"Ohm": "ohm", "Ω": "ohm", "°": "deg"}


def spelled(name: str | None) -> str:
    """``kg.m2/(s.K)`` as ``kg*m**2/(s*K)``; a missing one is a pure number."""
    if not name or name in _READABLE:
        return _READABLE[name] if name else "1"
    text = re.sub(r"([A-Za-zΩµ°%])(-?\d+)", r"\1**\2", name.replace(" ", ""))
    text = re.sub(r"\.(?=[A-Za-zΩµ°%(1])", "*", text)
    for symbol, known in _SYMBOLS.items():
        text = text.replace(symbol, known)
    above, per, below = text.partition("/")
    several = "*" in below.replace("**", "") and "(" not in below
    return f"{above}{per}({below})" if several else text
