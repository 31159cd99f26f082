"""How many joints the headings of recordings tell of."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from evertwin.starter.looks.seen import Seen


def told_joints(seen: Sequence[Seen]) -> int:
    """How many numbers, from 0 or 1 on, most headings count through; 0: none does."""
    stems: dict[tuple[int, str], set[int]] = {}
    for s, one in enumerate(seen):
        for column in one.columns:
            for found in re.finditer(r"\d+", column.name):
                stem = f"{column.name[: found.start()]}#{column.name[found.end() :]}"
                stems.setdefault((s, stem), set()).add(int(found[0]))
    whole = (
        len(there) for there in stems.values()
        if len(there) > 1 and min(there) in (0, 1) and max(there) - min(there) == len(there) - 1
    )  # fmt: skip
    return max(Counter(whole).items(), key=lambda one: (one[1], one[0]), default=(0, 0))[0]
