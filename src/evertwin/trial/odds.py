"""An e-value in the words of whoever keeps the machine: what a bet on it would have brought."""

from __future__ import annotations

SURE = 1e6
ODDS = ", odds of "
"""What stands before it in a sentence."""


def odds(value: float) -> str:
    """Of an e-value.

    >>> odds(243.6), odds(0.984), odds(3e17)
    ('244 to 1', '0.984 to 1', 'more than a million to 1')
    """
    return "more than a million to 1" if value > SURE else f"{value:.3g} to 1"
