"""`evertwin.life/1`: the JSON document of predicted lives, one entry per component.

>>> from evertwin.prognosis.laws.indicator import Limit
>>> friction = Indicator.of("friction", "Nm", Limit(3.0), [0, 1], [1.0, 1.1])
>>> entry = component(friction, NotEnough("at least 6 values"))
>>> entry["life"]
{'verdict': 'not enough data', 'needs': 'at least 6 values'}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evertwin.prognosis.laws.indicator import Indicator
from evertwin.prognosis.laws.life import Life, NotEnough

SCHEMA = "evertwin.life/1"


def component(
    indicator: Indicator, life: Life | NotEnough, dates: Sequence[float] = ()
) -> dict[str, object]:
    """``components.<name>`` of the document; ``dates`` are times from now, in the life's unit."""
    known = indicator.value[np.isfinite(indicator.value)]
    weights = {name: round(float(w), 4) for name, w in life.laws.items()}
    before: dict[str, float] | None = None
    if isinstance(life, Life):
        before = {f"{date:.12g}": life.probability_before(date) for date in dates}
    return {
        "indicator": indicator.name,
        "unit": indicator.unit,
        "value": float(known[-1]) if len(known) else None,
        "limit": indicator.limit.value,
        "direction": indicator.limit.direction,
        "limit_source": indicator.limit.source,
        "law": max(weights, key=lambda name: weights[name]) if weights else None,
        "laws": weights,
        "life": life.document(),
        "probability_before": before,
    }


def document(components: Mapping[str, dict[str, object]]) -> dict[str, object]:
    """The whole document.

    >>> document({})["schema"]
    'evertwin.life/1'
    """
    return {"schema": SCHEMA, "components": dict(components)}
