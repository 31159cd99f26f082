"""Every term that could be tried: its structure, where its numbers start, and within what bounds.

The list depends on nothing but the channels, the kinds that are allowed and the ranges in the data,
so that one procedure serves every machine. Each kind proposes its own.

>>> from evertwin.fold import make_block
>>> import numpy as np
>>> from evertwin.machines.mobile import Robot1D
>>> rows = make_block(t=np.arange(9) * 10**9, u=np.arange(9.0)[:, None], y=np.zeros((9, 1)))
>>> seen = Rows(Robot1D(), (rows,), ("v",), 2.0)
>>> [(c.term.kind, c.term.variant) for c in propose(seen, ("law",))]
[('law', ''), ('law', 'clamp'), ('law', 'dead zone')]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evertwin.models.terms.contract import Candidate
from evertwin.models.terms.registry import KINDS, kind
from evertwin.models.terms.rows import Rows


def propose(rows: Rows, kinds: Sequence[str]) -> tuple[Candidate, ...]:
    """All candidates of these kinds, simplest first; then by channel, all inputs before one."""
    ordered = [*(k for k in KINDS if k in kinds), *(k for k in kinds if k not in KINDS)]
    found = [candidate for name in ordered for candidate in kind(name).propose(rows)]
    places = {"*": -1} | {name: k for k, name in enumerate(rows.chosen)}
    last = len(places)
    return tuple(sorted(found, key=lambda c: (c.tier, places.get(c.term.channel, last))))


def unstarted(candidate: Candidate) -> Candidate:
    """What a state of its own begins with is estimated, not fitted.

    >>> from evertwin.models.form import Term
    >>> some = Candidate(Term("state", "T"), 2, ((0.1, 0.1, 0.0),), (0,) * 3, (1,) * 3, (0.1,) * 3)
    >>> unstarted(some).fixed
    (2,)
    """
    own = kind(candidate.term.kind)
    names = [one.name for one in own.parameters(candidate.term, "1", "1")] if own.initials else []
    starts = tuple(k for k, name in enumerate(names) if name in own.initials)
    return replace(candidate, fixed=(*candidate.fixed, *starts))
