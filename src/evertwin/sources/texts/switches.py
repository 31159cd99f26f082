"""Columns of words that say whether something is on: a pump that runs, a valve that is open.

Only a column of such words alone is read so. In one of numbers ``off`` says that there is none.

>>> rows = [[b"0", b"AUS"], [b"1", b"EIN"], [b"2", b"EIN"]]
>>> kinds_of_columns(["nt", "nt", "nt"], rows, 2), kinds_of_columns(["nt"], [[b"0", b"AUTO"]], 2)
('nb', 'nt')
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

_PAIRS = (
    "on off", "yes no", "open closed", "running stopped", "run stop", "active inactive",
    "enabled disabled", "ein aus", "an aus", "auf zu", "ja nein", "wahr falsch", "vrai faux",
    "oui non", "marche arret", "vero falso", "acceso spento", "verdadero falso",
)  # fmt: skip
SWITCHED = {word.encode(): float(k == 0) for pair in _PAIRS for k, word in enumerate(pair.split())}
"""Words of a switch, in lower case, beside those of `TRUTH`."""


def kinds_of_columns(kinds: Sequence[str], rows: Sequence[Sequence[bytes]], fields: int) -> str:
    """One letter a column: what most of its cells are, a switch where all of them say so.

    Args:
        kinds: the letters of each row's cells.
        rows: the cells.
        fields: cells of a complete row; others do not count.
    """
    full = [(kind, row) for kind, row in zip(kinds, rows, strict=True) if len(kind) == fields]
    out = []
    for j in range(fields):
        seen = Counter(kind[j] for kind, _ in full if kind[j] != "?")
        letter = seen.most_common(1)[0][0] if seen else "?"
        said = (row[j].lower() in SWITCHED for kind, row in full if kind[j] != "?")
        out.append("b" if letter == "t" and all(said) else letter)
    return "".join(out)
