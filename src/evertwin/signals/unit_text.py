"""A unit as it is written: a product of symbols with powers, read by a grammar of bounded size.

    unit   = factor { ("*" | "·" | "." | "/" | blank) factor }
    factor = ("1" | symbol | "(" unit ")") [power]
    power  = ("^" | "**") number | raised digits | "-" digit, right behind its symbol

Nothing is evaluated: a text that is longer, deeper or of a higher power than any unit needs is no
unit. ``Nm`` and its relatives are written without a sign between, and are taken apart here.

>>> factors("J/(kg·K)"), factors("m s⁻²"), factors("kNm"), factors("m3/h")[0]
((('J', 1.0), ('kg', -1.0), ('K', -1.0)), (('m', 1.0), ('s', -2.0)), (('kN', 1.0), ('m', 1.0)), \
('m', 3.0))
>>> factors("9^999999999"), factors("m,s")
(None, None)
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

LONGEST = 64
"""Signs of the longest text that is read."""
DEEPEST = 4
"""Brackets within brackets."""
HIGHEST = 12.0
"""The largest power of a symbol."""

Factors: TypeAlias = "tuple[tuple[str, float], ...]"

_RAISED = str.maketrans("⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹", "-+0123456789")
_NUMBER = r"[+-]?\d{1,2}(?:\.\d{1,3})?"
_TOKEN = re.compile(
    rf"""\s*(?:
    (?P<symbol>[°Δ]*[^\W\d_⁰¹²³⁴-⁹](?:(?![⁰¹²³⁴-⁹])\w)*|[°%‰]|1(?![\d.]))
    |(?P<power>(?:\*\*|\^)\s*(?:{_NUMBER}|\(\s*{_NUMBER}(?:/\d{{1,2}})?\s*\))|[⁻⁺]?[⁰¹²³⁴-⁹]{{1,2}}|(?<=[^\W\d_])-[1-9](?![\d.]))
    |(?P<sign>[*/·.()])
    )""",
    re.VERBOSE,
)
_NONE = {"-", "–", "a.u.", "a. u.", "arb. unit", "arb. units", "arb.u."}
"""What headings write of a number that has no unit, or one of its own."""
_SPELT: dict[str, Factors] = {
    "1": (), "dimensionless": (), "°": (("degree", 1.0),), "deg": (("degree", 1.0),),
    "kgm2": (("kg", 1.0), ("m", 2.0)),
}  # fmt: skip
_NEWTONS = re.compile(r"([Mkcmµμu]?N)(mm|ms|m|s)")
"""``kNm`` and ``Nms``, which elsewhere are a yarn's fineness."""
_RAISED_BASE = re.compile(r"([kcdmµμ]?m|s|ft|in)([2-4])")
"""``m3`` and ``s2``, as headings write them."""
_ARMS: dict[str, Factors] = {
    "mm": (("mm", 1.0),), "ms": (("m", 1.0), ("s", 1.0)), "m": (("m", 1.0),), "s": (("s", 1.0),),
}  # fmt: skip


_EFFECTIVE = re.compile(r"(?<=[AV])[_ ]?(?:[Ee]ff|rms|RMS)$")


def plain(text: str) -> str:
    """A unit without the word that its values are effective ones (root mean square).

    >>> plain("Aeff"), plain("mA_rms"), plain("V RMS"), plain("farms")
    ('A', 'mA', 'V', 'farms')
    """
    return _EFFECTIVE.sub("", text)


@lru_cache(4096)
def factors(text: str) -> Factors | None:
    """(symbol, power) of a unit, in order; None for a text that is none."""
    text = plain(text)
    if text in _NONE:
        return ()
    tokens = _tokens(text)
    if tokens is None:
        return None
    reader = _Reader(tokens)
    found = reader.product(0)
    if found is None or reader.at < len(tokens):
        return None
    return found if all(abs(power) <= HIGHEST for _, power in found) else None


def _tokens(text: str) -> list[tuple[str, str]] | None:
    """(kind, text) of each part; None where a sign belongs to no unit, or two symbols touch."""
    if len(text) > LONGEST:
        return None
    out: list[tuple[str, str]] = []
    at, end = 0, len(text.rstrip())
    while at < end:
        found = _TOKEN.match(text, at)
        if found is None or found.lastgroup is None:
            return None
        touches = bool(out) and out[-1][0] == "symbol" and found.start(found.lastgroup) == at
        if touches and found.lastgroup == "symbol":
            return None
        out.append((found.lastgroup, found[found.lastgroup]))
        at = found.end()
    return out


@dataclass
class _Reader:
    tokens: list[tuple[str, str]]
    at: int = 0

    def take(self, *signs: str) -> str:
        """The next sign if it is one of ``signs``, else nothing."""
        if self.at < len(self.tokens) and self.tokens[self.at] in {("sign", s) for s in signs}:
            self.at += 1
            return self.tokens[self.at - 1][1]
        return ""

    def product(self, depth: int) -> Factors | None:
        found = self.factor(depth)
        while found is not None and self.at < len(self.tokens):
            if self.tokens[self.at] == ("sign", ")"):
                break
            sign = self.take("*", "/", "·", ".")
            more = self.factor(depth)
            if more is None:
                return None
            found += tuple((s, -p) for s, p in more) if sign == "/" else more
        return found

    def factor(self, depth: int) -> Factors | None:
        base = self.base(depth)
        if base is None or self.at >= len(self.tokens) or self.tokens[self.at][0] != "power":
            return base
        power = _power(self.tokens[self.at][1])
        self.at += 1
        if power is None:
            return None
        if base == (("kgm", 1.0),):  # kgm^2 is kg·m^2
            return ("kg", 1.0), ("m", power)
        return tuple((symbol, p * power) for symbol, p in base)

    def base(self, depth: int) -> Factors | None:
        if self.at >= len(self.tokens):
            return None
        kind, text = self.tokens[self.at]
        if kind == "symbol":
            self.at += 1
            return _spelt(text)
        if depth >= DEEPEST or not self.take("("):
            return None
        inside = self.product(depth + 1)
        return inside if inside is not None and self.take(")") else None


def _spelt(symbol: str) -> Factors:
    newtons = _NEWTONS.fullmatch(symbol)
    if newtons is not None:
        return (newtons[1], 1.0), *_ARMS[newtons[2]]
    raised = _RAISED_BASE.fullmatch(symbol)
    if raised is not None:
        return ((raised[1], float(raised[2])),)
    return _SPELT.get(symbol, ((symbol, 1.0),))


def _power(text: str) -> float | None:
    """The number of a power: ``^2``, ``**(1/2)``, ``⁻¹``."""
    plain = text.translate(_RAISED).lstrip("*^ ").strip("() ")
    above, _, below = plain.partition("/")
    return None if below and not float(below) else float(above) / float(below or 1)
