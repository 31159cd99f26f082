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
    later = [
        pytest.param(*(draw if isinstance(draw, tuple) else (draw,)), marks=pytest.mark.long)
        for draw in others
    ]
    return pytest.mark.parametrize(names, [first, *later])
