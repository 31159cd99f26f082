"""A reason in the past tense: what an alarm said, once it is over.

>>> past("level is off by 14.3 cm (limit 10 mm)")
'level was off by 14.3 cm (limit 10 mm)'
>>> past("speed looks off by +60 rpm; nothing is learned until it can")
'speed looked off by +60 rpm; nothing was learned until it could'
"""

from __future__ import annotations

import re

_WAS = {
    "is": "was", "are": "were", "has": "had", "looks": "looked", "can": "could", "does": "did",
    "cannot": "could not", "explains": "explained", "fits": "fitted", "now": "then",
    "depends": "depended", "drives": "drove", "makes": "made", "predicts": "predicted",
    "reaches": "reached", "scatters": "scattered",
}  # fmt: skip
_WORD = re.compile(rf"(?<![\w.-])({'|'.join(_WAS)})(?![\w.-]\w)\b")


def past(reason: str) -> str:
    """The reason, as one tells of what is over."""
    return _WORD.sub(lambda found: _WAS[found[1]], reason)
