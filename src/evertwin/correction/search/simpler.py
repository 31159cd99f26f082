"""The plain kind in place of a richer one that comes down to it, such as a dead zone for a
hysteresis: what was found before a lag was known may have stood for it."""

from __future__ import annotations

from collections.abc import Sequence

from evertwin.correction.evidence import Evidence
from evertwin.correction.numbers.fitting import Scored, confirm, fit_candidate
from evertwin.models.terms.contract import Candidate

SWAP = 1.0
"""Standard errors by which a richer term has to be better than the simpler ones in whose place it
comes: of forms that both pay, the simplest within one standard error of the best."""


def simpler(
    now: Scored, k: int, candidates: Sequence[Candidate], evidence: Evidence
) -> tuple[Candidate, Scored] | None:
    """The best candidate of the plain kind, with fewer numbers if that is its own, in place of part
    ``k``; None: there is none."""
    part, found = now.stack.parts[k], list[tuple[Candidate, Scored]]()
    for one in candidates:
        plain = one.term.kind == part.kind.plain and one.term.channel == part.term.channel
        if plain and (one.term.kind != part.term.kind or len(one.low) < len(part.values)):
            found.append((one, fit_candidate(now.stack.without(k), one, evidence)))
    if not found:
        return None
    candidate, scored = min(found, key=lambda pair: pair[1].mean)
    return candidate, confirm(scored, evidence)
