"""One cell of a text table: a number, no value, or a word.

>>> number_of(b"1.5"), number_of(b"n/a"), number_of(b"on"), number_of(b"on", switch=True)
(1.5, nan, None, 1.0)
"""

from __future__ import annotations

import re

from evertwin.sources.texts.dialect import MISSING, TRUTH
from evertwin.sources.texts.switches import SWITCHED

_NONE = re.compile(rb"[+-]?1\.#(ind|qnan|snan|inf)0*", re.IGNORECASE)
"""What Windows prints of a division by zero."""


def number_of(cell: bytes, switch: bool = False) -> float | None:
    """The number of one cell, NaN for an empty one, None for text; ``switch``: in a column of
    words that say whether something is on."""
    low = cell.lower()
    if switch and low in SWITCHED:
        return SWITCHED[low]
    if low in MISSING:
        return float("nan")
    if low in TRUTH:
        return TRUTH[low]
    if b"_" in cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return None


def worded(cell: bytes) -> bool:
    """Is it a word that no number can be meant by, such as a logger writes where it has none?

    >>> [worded(c) for c in (b"I/O Timeout", b"---", b"##", b"#DIV/0!", b"E104", b"-1.#IND")]
    [True, True, True, True, True, True]
    >>> [worded(c) for c in (b"1,049", b"12 mm", b"<0.5", b"$5", b"0x1F", b"1_0")]
    [False, False, False, False, False, False]
    """
    opens = cell[:1].isalpha() or cell[:1] == b"#"
    return opens or not any(48 <= sign <= 57 for sign in cell) or _NONE.fullmatch(cell) is not None
