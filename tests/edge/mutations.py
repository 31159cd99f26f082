"""One thing wrong in a file: bytes that rot, texts that a stranger writes, numbers beyond any.

>>> mutated(b"a = 1", binary=False, seed=0) == mutated(b"a = 1", binary=False, seed=0)
True
"""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable

__all__ = ["mutated"]

NUMBERS = [
    "0", "-1", "1e12", "1e308", "1e-308", "1e999", "-1e999", "9" * 400, "9" * 20, "1__0", "1_0",
    "_1", "0x10", "nan", "inf", "-inf", "NaN", "1e", "1.2.3", "1,5", "--1", "+", ".", "1e+-2",
    "٣", "１２", "9223372036854775807", "9223372036854775808", "-9223372036854775808", "2147483648",
    "0.1e-400", "1/3", "1e12 m", "1__0 m", "5 m/0", "5 dBm", "9^999999999 m", "2 furlong", "1 kg",
    "5 s", "1e400 s", "0" * 5000 + "1", "1" + "0" * 5000, "1.0" + "0" * 5000, "true", "null",
    "1+2j", "1e99999999999",
]  # fmt: skip
WORDS = [
    "", " ", "\0", "\n", "\r", "\t", '"', "'", '"""', "'''", "\\", "\\u0000", "#", "%", "//", ";",
    ",", "x [9^999999999]", "x [m/0]", "x [dB]", "x [(((((m)))))]", "x [" + "m/" * 500 + "s]",
    "[m", "m]", "=", "==", "]", "[", "[[", "]]", "{", "}", "{{", "${HOME}", "${NOPE}",
    "../../etc/passwd", "a" * 9000, "a." * 2000 + "a", "[" * 2000, "[" * 200 + "]" * 200,
    "{a=" * 500, "(" * 3000, "\u202e", "\ufeff", "\u200b", "é", "°C", "µm", "\x1b[31m",
    "__import__('os')", "1 if 1 else 2", "x**x**x**x", "9**9**9", "%s%s%s%n",
    "<!DOCTYPE a [<!ENTITY b 'c'>]>", "&b;", "<a>" * 900, "NaN", "None", "@1:2", "*", "?",
    "{1..999999999}", "{1..6}", "{0,1,2}", "t", "x", "y", "time", "s", "ms", "ns", "iso", "auto",
]  # fmt: skip
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w.]*")

Change = Callable[[bytes, random.Random], bytes]


def mutated(content: bytes, *, binary: bool, seed: object) -> bytes:
    """``content`` with one thing wrong, or two; the same for the same ``seed``."""
    rng = random.Random(repr(seed))
    for _ in range(1 if rng.random() < 0.7 else 2):
        changes = BYTES if binary or rng.random() < 0.3 else TEXTS
        content = rng.choice(changes)(content, rng)
    return content


def _at(content: bytes, rng: random.Random) -> int:
    """A place; heads and tails, where the structure is, more often."""
    n = max(len(content), 1)
    share = rng.random()
    if share < 0.35:
        return rng.randrange(min(n, 400))
    return n - 1 - rng.randrange(min(n, 400)) if share < 0.55 else rng.randrange(n)


def _bit(content: bytes, rng: random.Random) -> bytes:
    at, out = _at(content, rng), bytearray(content)
    out[at : at + 1] = bytes([(out[at] if out else 0) ^ (1 << rng.randrange(8))])
    return bytes(out)


def _byte(content: bytes, rng: random.Random) -> bytes:
    at = _at(content, rng)
    return content[:at] + bytes([rng.randrange(256)]) + content[at + 1 :]


def _integer(content: bytes, rng: random.Random) -> bytes:
    """Four or eight bytes become an extreme number."""
    at, form = _at(content, rng), rng.choice(("<i", "<q", ">i", ">q", "<d"))
    value: float = rng.choice([0, 1, -1, 2**31 - 1, -(2**31), 2**30])
    if form[1] == "q":
        value = rng.choice([value, 2**63 - 1, -(2**63), 2**40])
    if form[1] == "d":
        value = rng.choice([float("nan"), float("inf"), 1e308, -1e308, 5e-324])
    new = struct.pack(form, value)
    return content[:at] + new + content[at + len(new) :]


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: _at(content, rng)]


def _without(content: bytes, rng: random.Random) -> bytes:
    at = _at(content, rng)
    return content[:at] + content[at + rng.choice([1, 2, 8, 64, 500]) :]


def _twice(content: bytes, rng: random.Random) -> bytes:
    at, size = _at(content, rng), rng.choice([1, 8, 64, 500, 3000])
    return content[: at + size] + content[at:]


def _noise(content: bytes, rng: random.Random) -> bytes:
    at, size = _at(content, rng), rng.choice([1, 4, 16, 200])
    return content[:at] + rng.randbytes(size) + content[at + rng.choice([0, size]) :]


def _zeros(content: bytes, rng: random.Random) -> bytes:
    at, size = _at(content, rng), rng.choice([1, 4, 64, 512])
    return content[:at] + bytes(size) + content[at + size :]


def _swapped(content: bytes, rng: random.Random) -> bytes:
    a, b = sorted((_at(content, rng), _at(content, rng)))
    size = min(rng.choice([1, 8, 64]), b - a)
    return (
        content[:a]
        + content[b : b + size]
        + content[a + size : b]
        + content[a : a + size]
        + content[b + size :]
    )


def _found(
    pattern: re.Pattern[bytes], content: bytes, rng: random.Random
) -> re.Match[bytes] | None:
    """One of the first or of all hits: headings are few, rows are many."""
    hits = list(pattern.finditer(content))
    if not hits:
        return None
    return rng.choice(hits[:12] if rng.random() < 0.5 else hits)


def _number(content: bytes, rng: random.Random) -> bytes:
    hit = _found(_NUMBER, content, rng)
    new = rng.choice(NUMBERS).encode()
    return new + content if hit is None else content[: hit.start()] + new + content[hit.end() :]


def _word(content: bytes, rng: random.Random) -> bytes:
    hit = _found(_WORD, content, rng)
    new = rng.choice(WORDS).encode()
    return new + content if hit is None else content[: hit.start()] + new + content[hit.end() :]


def _inserted(content: bytes, rng: random.Random) -> bytes:
    at = _at(content, rng)
    return content[:at] + rng.choice([*WORDS, *NUMBERS]).encode() + content[at:]


def _lines(content: bytes, rng: random.Random) -> bytes:
    """A line lost, doubled, repeated a thousand times, moved or split."""
    lines = content.split(b"\n")
    at = rng.randrange(min(len(lines), 8) if rng.random() < 0.5 else len(lines))
    how = rng.randrange(5)
    if how == 0:
        del lines[at]
    elif how == 1:
        lines.insert(at, lines[at])
    elif how == 2:
        lines[at:at] = [lines[at]] * 1000
    elif how == 3:
        lines.insert(rng.randrange(len(lines)), lines.pop(at))
    else:
        half = len(lines[at]) // 2
        lines[at : at + 1] = [lines[at][:half], lines[at][half:]]
    return b"\n".join(lines)


def _signs(content: bytes, rng: random.Random) -> bytes:
    """One sign for another, everywhere."""
    old, new = (
        rng.choice([b",;", b";,", b".,", b"\t,", b" \t", b"=:", b"\"'", b"[(", b"][", b"-_"][:9]),
        b"",
    )
    return content.replace(old[:1], old[1:] or new)


def _encoded(content: bytes, rng: random.Random) -> bytes:
    text = content.decode("utf-8", "replace")
    how = rng.choice(["utf-16", "utf-16-be", "utf-8-sig", "crlf", "cr", "latin", "shout"])
    if how in ("crlf", "cr"):
        return content.replace(b"\n", b"\r\n" if how == "crlf" else b"\r")
    if how == "latin":
        return "Gerät µ°".encode("cp1252") + content
    return content.upper() if how == "shout" else text.encode(how, "replace")


BYTES: list[Change] = [_bit, _byte, _integer, _cut, _without, _twice, _noise, _zeros, _swapped]
TEXTS: list[Change] = [
    _number,
    _number,
    _word,
    _word,
    _inserted,
    _lines,
    _lines,
    _signs,
    _encoded,
    _cut,
]
