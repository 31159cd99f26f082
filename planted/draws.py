"""Draws of a test: the first in each run of the tests, all of them in the proofs.

>>> first_of("seed", range(3)).args[1][1].marks[0].name
'long'
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def first_of(names: str | Sequence[str], draws: Iterable[Any]) -> pytest.MarkDecorator:
    """`parametrize`, the draws behind the first marked `long`."""
    first, *others = draws
    return pytest.mark.parametrize(names, [first, *map(_later, others)])


def _later(draw: Any) -> Any:
    """A value, several of them, or a `pytest.param`."""
    if isinstance(draw, tuple) and hasattr(draw, "marks"):
        return pytest.param(*draw.values, marks=[*draw.marks, pytest.mark.long], id=draw.id)
    values = draw if isinstance(draw, tuple) else (draw,)
    return pytest.param(*values, marks=pytest.mark.long)
