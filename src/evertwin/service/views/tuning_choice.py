"""What a running twin tunes, how often, and why: the method of `evertwin engineer`, asked anew of
the newest rows, with the parameters as they are now.

Components, their rank and the depth of their models come from the breakdown that ``[prognosis]
breakdown`` names. Where there is none, what each signal tells of each tuned parameter is answered
all the same, and what cannot be told is said:

>>> UNTOLD
('how critical each component is cannot be told: the twin file names no [prognosis] breakdown',)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from evertwin.config import TwinSpec
from evertwin.engineering.breakdown import read_breakdown
from evertwin.engineering.mapping import links
from evertwin.engineering.sensitivity import few
from evertwin.engineering.study import modelled, study
from evertwin.fold import Block, plain
from evertwin.service.twin.questions import reading
from evertwin.twin import Twin

UNTOLD = (
    "how critical each component is cannot be told: the twin file names no [prognosis] breakdown",
)


def engineered(spec: TwinSpec, blocks: Sequence[Block]) -> Mapping[str, Any]:
    """The answer, by a copy of the twin that only reads its store; errors as `choices`."""
    with reading(spec) as twin:
        return choices(twin, blocks)


def choices(twin: Twin, blocks: Sequence[Block]) -> Mapping[str, Any]:
    """In plain values; ``tuned``: what the twin file says of each parameter's turn.

    Raises:
        ConfigError: the breakdown cannot be read, or is of another model.
        DataError: there are no rows that count.
        ModelError: a simulation inside a parameter's range diverged.
    """
    posed, rule = twin.problem(blocks), twin.spec.tuning
    tuned = {
        "parameters": {name: rule.weights.get(name, 1.0) for name in posed.names},
        "every": rule.every if math.isfinite(rule.every) else None,
    }
    spans = [float(block.t[-1] - block.t[0]) * 1e-9 for block in blocks if len(block.t)]
    about = {"tuned": tuned, "version": twin.champion.number, "span": sum(spans)}
    file = twin.spec.prognosis.breakdown
    if file is None:
        short = few(posed)
        seen = [{"parameter": one.parameter, "signals": [s._asdict() for s in one.signals]}
                for one in links(short)]  # fmt: skip
        return plain({**about, "components": [], "links": seen, "notes": UNTOLD,
                      "rows": len(short.rows.u)})  # type: ignore[return-value]  # fmt: skip
    breakdown = read_breakdown(Path(twin.spec.folder) / file)
    names = modelled(breakdown, posed.model.parameters.names)
    found = study(breakdown, replace(posed, editable=names), tried=False).to_dict()
    wanted = {one.name: one.about for one in breakdown.components}
    told = {**found, **about, "about": breakdown.about, "of": wanted}
    return plain(told)  # type: ignore[return-value]
