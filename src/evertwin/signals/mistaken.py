"""Units that are taken for each other, and signs that are turned: the one table of them.

>>> round(next(m for m in mistaken("degC", "K") if "Fahrenheit" in m.said).of(310.15), 2)
371.75
>>> [m.said for m in mistaken("bar", "Pa") if round(m.number, 1) == 14.5]
['psi for bars']
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from evertwin.signals.units import compatible, conversion_of

SIGN = -1.0
TURN = 57.29577951308232
"""180/π, the only factor of an angle."""
PURE = 3.0
"""Factor of a pure number, of which nobody knows the quantity, from which no machine changes so."""

LENGTHS = ("m", "m/s", "m/s^2")
"""SI units of what a unit of length divides."""


class Factor(NamedTuple):
    """A number that divides two units.

    >>> Factor(3.6, ("m/s",), "km/h for m/s").number
    3.6
    """

    number: float
    units: tuple[str, ...]
    """SI units of the quantities whose units it divides; none: of any."""
    said: str
    """What it stands for; the inverse is that the other way round."""


FACTORS = (
    *(Factor(10.0**n, (), "a decimal prefix") for n in (1, 2, 3, 6, 9)),
    Factor(TURN, ("rad", "rad/s", "rad/s^2"), "degrees for radians"),
    Factor(25.4, LENGTHS, "millimetres for inches"),
    Factor(1.0 / 0.0254, LENGTHS, "inches for metres"),
    Factor(1.0 / 0.3048, LENGTHS, "feet for metres"),
    Factor(30.0 / math.pi, ("rad/s",), "rpm for rad/s"),
    Factor(9.80665, ("N", "m/s^2"), "newtons for kilograms"),
    Factor(60.0, ("m/s", "rad/s", "m^3/s", "kg/s", "1/s", "s"), "another unit of time"),
    Factor(4.44822, ("N",), "newtons for pounds"),
    Factor(1.35582, ("Nm",), "newton metres for foot pounds"),
    Factor(8.85075, ("Nm",), "inch pounds for newton metres"),
    Factor(6.89476, ("Pa",), "kilopascals for psi"),
    Factor(14.5038, ("Pa",), "psi for bars"),
    Factor(7.50062, ("Pa",), "millimetres of mercury for kilopascals"),
    Factor(3.6, ("m/s",), "km/h for m/s"),
    Factor(2.23694, ("m/s",), "miles an hour for m/s"),
    Factor(2.20462, ("kg", "kg/s"), "pounds for kilograms"),
    Factor(16.6667, ("m^3/s",), "l/min for m^3/h"),
    Factor(4.40287, ("m^3/s",), "gallons a minute for m^3/h"),
    Factor(3.78541, ("m^3/s", "m^3"), "litres for gallons"),
    Factor(SIGN, (), "a turned sign"),
)
"""Every number that channels are tried with: by a fit all, in the stream those from `PURE` on. New
ones go before the sign: a state of the stream that was kept counts by their places."""
_SCALES = {"K": ("kelvin", 1.0, 0.0), "degC": ("degrees Celsius", 1.0, 273.15),
           "degF": ("degrees Fahrenheit", 5.0 / 9.0, 273.15 - 160.0 / 9.0)}  # fmt: skip
"""Scales of temperature: their names, what one degree is [K], their zero [K]."""


class Mistake(NamedTuple):
    """What a channel reads where it is in another unit: ``number · true + shift``, in SI.

    >>> round(Mistake(-1.0, 546.3, "a turned sign").of(293.15), 2)
    253.15
    """

    number: float
    shift: float
    said: str
    scale: bool = False
    """Is it of another scale, not of another factor?"""

    def of(self, true: float) -> float:
        """What is recorded of it."""
        return self.number * true + self.shift


def numbers(unit: str, recorded: str = "") -> Iterator[tuple[float, str]]:
    """Numbers that divide two units of a quantity (SI ``unit``), what they stand for; the inverses.
    A pure number that is ``recorded`` in a unit, as per cent, is a share: of no other quantity.

    >>> [round(number, 4) for number, told in numbers("rad")][-3:]
    [57.2958, 0.0175, -1.0]
    >>> sorted({told for number, told in numbers("1", "%")})
    ['a decimal prefix', 'a turned sign']
    """
    pure = unit == "1"
    for factor in FACTORS:
        if factor.units and not (
            recorded in ("", "1") and factor.number > PURE
            if pure
            else any(compatible(unit, u) for u in factor.units)
        ):
            continue
        yield factor.number, factor.said
        if factor.number > 0.0:
            one, _, other = factor.said.partition(" for ")
            yield 1.0 / factor.number, f"{other} for {one}" if other else factor.said


def mistaken(recorded: str, unit: str) -> Iterator[Mistake]:
    """All that a column may be which is said to be in ``recorded``, of an SI ``unit``.

    A factor or a sign is one of the number that is recorded, so about the zero of its unit.
    """
    scale, zero = conversion_of(recorded)
    for number, said in numbers(unit, recorded):
        yield Mistake(number, zero * (1.0 - number), said)
    if unit == "1" and recorded in ("", "1"):
        own = {name: (1.0, place / size) for name, (_, size, place) in _SCALES.items()}
        pairs = [(a, b) for a in own for b in own if a != b]
    elif compatible(unit, "K"):
        pairs = [("", name) for name in _SCALES]
    else:
        return
    for a, b in pairs:
        told, size, place = _SCALES[b]
        if a:  # a pure number of the one scale, read as one of the other
            number, shift = _SCALES[a][1] / size, (_SCALES[a][2] - place) / size
        else:
            number, shift = scale / size, zero - place * scale / size
        if abs(number - 1.0) > 1e-9 or abs(shift) > 1e-9:
            of = f" for {_SCALES[a][0]}" if a else ""
            yield Mistake(number, shift, f"{told}{of}", scale=True)
