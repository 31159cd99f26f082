"""Numbers of a form that no slope leads to, where a fit has to leave them: sought on some rows.

A dead zone that was learned before some command came may end elsewhere. When that command comes,
the version is off as if the machine had changed, and no fit brings it back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evertwin.correction.candidates import propose
from evertwin.correction.evidence import gather
from evertwin.correction.numbers.sliding import SHARES, slid
from evertwin.correction.stack import stack_of
from evertwin.fold import Windows
from evertwin.models import Model
from evertwin.models.form import Form
from evertwin.models.terms.registry import kind
from evertwin.models.terms.rows import Rows
from evertwin.types import ParameterVector

NEAR = 0.05
"""Share of its bound that is a considerable change at least: these rows may have other commands."""
FAR = (5.0, 2.0)
"""Of such a change, by which it is moved first: up to the next command all are alike."""


def slides(form: Form) -> bool:
    """Has a form such numbers?"""
    return any(kind(term.kind).slopeless for term in form.terms)


def slid_numbers(
    model: Model, form: Form, p: ParameterVector, windows: Windows, horizon: float,
    channels: Sequence[str] = (),
) -> ParameterVector:  # fmt: skip
    """The parameters of a form's model with such numbers as these rows tell them beside the others.

    Args:
        model: base model, without terms.
        channels: inputs that may be corrected.

    Raises:
        TooFew: too few predictions.
    """
    stack = stack_of(model, form, p)
    rows = Rows(stack.base, tuple(windows), tuple(channels), horizon)
    kinds = tuple(dict.fromkeys(term.kind for term in form.terms))
    known = {one.key: one for one in propose(rows, kinds)}
    parts, some = list(stack.parts), list[int]()
    for k, part in enumerate(parts):
        term = part.term
        found = known.get((term.kind, term.channel, term.source, term.variant))
        if found is not None and part.kind.slopeless and found.fixed:
            some_way = [max(a, NEAR * b) for a, b in zip(found.typical, found.high, strict=True)]
            parts[k] = replace(
                part, low=found.low, high=found.high, typical=tuple(some_way), fixed=found.fixed
            )
            some.append(k)
    if not some:
        return p
    stack = replace(stack, parts=tuple(parts))
    evidence = gather(stack.model, windows, horizon, p=p)
    return slid(stack, some, evidence, lambda moved: moved, (*FAR, *SHARES)).p
