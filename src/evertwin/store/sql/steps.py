"""How a file of an older schema becomes one of this: by a step from each schema to the next.

A schema that has no step stays refused: its log was chained in another way.
"""

from __future__ import annotations

from collections.abc import Mapping

STEPS: Mapping[int, tuple[str, ...]] = {
    2: ("CREATE INDEX samples_source_stop ON samples (source, stop)",),
}
"""Schema → the statements that make the next of it."""


def upgrade(schema: int, wanted: int) -> tuple[str, ...] | None:
    """All statements from one schema to another; None: there is no way.

    >>> len(upgrade(2, 3)), upgrade(1, 3), upgrade(4, 3)
    (1, None, None)
    """
    way = range(schema, wanted)
    if not way or any(one not in STEPS for one in way):
        return None
    return tuple(statement for one in way for statement in STEPS[one])
