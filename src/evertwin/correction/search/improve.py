"""Which terms pay: forward selection, simplest kinds first, judged on held-out predictions.

One procedure with one set of settings for every machine:

1. Score the stack as it is: mean deviation of segments over one horizon, held out.
2. Try every candidate of the present tier (laws of an input and couplings; then states; then
   tables and surfaces), on top of the stack, and in place of other static terms on its channel.
   Fit, score. Laws and couplings are tried at once: each can stand in for the other.
3. The best one joins if it lowers the held-out deviation by ``gain`` (5 %), and by ``sure``
   standard errors of the mean over segments; by one, where it takes the place of another. Refit
   the terms with few numbers together. Repeat from the simplest tier, whose terms may show only
   beside a law; when no candidate of the tier pays, climb.
4. At the end a term that no longer pays is dropped, and a number that changes nothing goes to its
   neutral value: a cap that no command reaches is none.

What comes out is a proposal. It goes live through a trial on unseen data only.

>>> import numpy as np
>>> from evertwin.fold import make_block
>>> from evertwin.machines.mobile import Robot1D
>>> rng = np.random.default_rng(0)
>>> u = np.repeat(rng.uniform(0.0, 0.2, 60), 5)
>>> y = np.minimum(u, 0.1).cumsum() + 1e-3 * rng.normal(size=300)
>>> rows = make_block(t=np.arange(300) * 10**9, u=u[:, None], y=y[:, None])
>>> proposal = improve(Robot1D(), Form(), (rows,), 5.0, Selection(kinds=("law",)))
>>> [term.kind for term in proposal.form.terms], proposal.gains[0].gain > 0.9
(['law'], True)
>>> proposal.describes
('v: saturation at 0.0999 m/s',)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.correction.candidates import propose, unstarted
from evertwin.correction.describe import describe
from evertwin.correction.evidence import Evidence, asked_of, gather, mean_deviation
from evertwin.correction.numbers.fitting import Scored, confirm, fit_candidate, refit, started
from evertwin.correction.search.absorbed import plainest
from evertwin.correction.search.own_numbers import own_numbers, unmoved
from evertwin.correction.search.simpler import SWAP, simpler
from evertwin.correction.stack import Stack, stack_of
from evertwin.errors import TooFew, UsageError
from evertwin.fold import Block, plain
from evertwin.models import Model, hidden_of, observed
from evertwin.models.form import Form, Term
from evertwin.models.terms.contract import FREE, SIMPLE, Candidate
from evertwin.models.terms.registry import KINDS, kind
from evertwin.models.terms.rows import Rows
from evertwin.types import Json, ParameterVector, Vector

TINY = 1e-12
UNASKED = 1e6
"""How many times its size counts as 1 of an output that is not asked about."""
MANY = 30
"""Segments from which on their scatter is known."""
NEAR = 0.01
"""Held-out deviations this near are equal: the simpler term wins."""


@dataclass(frozen=True)
class Selection:
    """Settings of the selection; the defaults serve every case.

    >>> Selection().gain
    0.05
    """

    kinds: tuple[str, ...] = KINDS
    """Kinds of term that may be tried."""
    channels: tuple[str, ...] = ()
    """Inputs (or states, for kinds that couple to one) that may be corrected; empty: all inputs."""
    gain: float = 0.05
    """Least relative gain in held-out deviation that a term must bring."""
    sure: float = 2.5
    """Least mean gain of a segment, in its standard errors over segments."""
    most: int = 6
    """Most terms that one proposal adds."""
    quantum: float = 0.0
    """Step of a table's levels; 0: proposed from the data."""
    outputs: tuple[str, ...] = ()
    """Outputs that terms have to pay on; empty: all. Nothing rides along that pays on others."""
    numbers: tuple[str, ...] = ()
    """Numbers of the base model that may take over the gain of a law."""
    beside: bool = False
    """Are they fitted beside every term? Few rows may not be sure of a term beside them."""
    least: int = MANY
    """Fewest segments that a search may be based on."""

    def __post_init__(self) -> None:
        if not 0.0 < self.gain < 1.0:
            raise UsageError(f"gain: expected a share within (0, 1), got {self.gain}")


@dataclass(frozen=True)
class Gain:
    """What one term brought, and on what evidence.

    >>> Gain(Term("lag", "*"), 1.0, 0.8, 100).gain
    0.19999999999999996
    """

    term: Term
    before: float
    """Mean held-out deviation before it joined, in units of the scale."""
    after: float
    segments: int
    replaced: tuple[Term, ...] = ()
    """Simpler terms whose place it took."""
    detail: str = ""

    @property
    def gain(self) -> float:
        """Relative gain."""
        return 1.0 - self.after / self.before if self.before > 0.0 else 0.0


@dataclass(frozen=True)
class Proposal:
    """A corrected form with its numbers; empty ``gains``: nothing pays, the form is as it was.

    >>> import numpy as np
    >>> Proposal(Form(), (), np.zeros(0), 1.0, 1.0, np.ones(1)).found
    False
    """

    form: Form
    names: tuple[str, ...]
    """Names of the parameters of the form's model."""
    p: ParameterVector
    before: float
    """Mean held-out deviation of the form as it was, in units of ``scale``."""
    after: float
    scale: Vector
    """Size that counts as 1 per output."""
    gains: tuple[Gain, ...] = ()
    """The new terms."""
    describes: tuple[str, ...] = ()
    """The terms in plain words."""
    tried: Mapping[str, float] = field(default_factory=dict)
    """Held-out gain of every candidate on the form as it was."""
    steps: tuple[Gain, ...] = ()
    """Every step on the way, terms that were replaced or dropped later included."""
    table: Mapping[str, Any] = field(default_factory=dict)
    """The translation table that a law was refined from: levels, values, visits, learned."""
    taken: tuple[str, ...] = ()
    """Gains of terms that numbers of the base model took over."""
    unseen: tuple[float, ...] = ()
    """Levels of the table that the machine was not at."""

    @property
    def found(self) -> bool:
        """Is there anything to try?"""
        return bool(self.gains)

    def evidence(self) -> dict[str, Json]:
        """The figures, for an event."""
        return {
            "before": self.before,
            "after": self.after,
            "terms": [
                {"kind": g.term.kind, "channel": g.term.channel, "gain": g.gain} for g in self.gains
            ],
            "steps": [g.detail for g in self.steps],
            "tried": dict(self.tried),
            **({"table": plain(self.table)} if self.table else {}),
        }


def improve(
    model: Model,
    form: Form,
    windows: Sequence[Block],
    horizon: float,
    settings: Selection | None = None,
    p: ParameterVector | None = None,
) -> Proposal:
    """Searches for terms on top of a form.

    Args:
        model: base model, without terms.
        form: present form; its terms stay, may be refitted, and may be replaced by richer ones.
        windows: rows to learn from; trusted rows only count.
        horizon: length of a prediction [s].
        p: parameters of the present form's model; default: its own.

    Raises:
        TooFew: too few segments.
        UsageError: the model is a static map.
    """
    chosen = settings or Selection()
    stack, evidence = prepare(model, form, windows, horizon, p, chosen.outputs)
    if evidence.segments < chosen.least:
        raise TooFew(
            f"correction: expected at least {chosen.least} segments of {evidence.horizon:g} s, got "
            f"{evidence.segments}: give more data or a shorter horizon"
        )
    rows = Rows(stack.base, tuple(windows), chosen.channels, evidence.horizon, chosen.quantum)
    candidates = propose(rows, chosen.kinds)
    begun = any(kind(one.term.kind).initials for one in candidates)
    hidden = len(hidden_of(observed(stack.model))) + begun
    known = evidence.settled(hidden + 1) if hidden else evidence
    tuned = own_numbers(stack, known, chosen.numbers if chosen.beside else ())
    if not tuned:
        return _Search(evidence, candidates, chosen, evidence).proposal(form, stack)
    search = _Search(known, tuple(map(unstarted, candidates)), chosen, evidence)
    return search.proposal(form, replace(stack, tuned=tuned))


def prepare(
    model: Model, form: Form, windows: Sequence[Block], horizon: float, p: ParameterVector | None,
    outputs: Sequence[str] = (),
) -> tuple[Stack, Evidence]:  # fmt: skip
    """The form as a stack, and the evidence; one unit of loss is what the bare model misses."""
    stack = stack_of(model, form, p)
    inner = stack.p[: len(stack.inner)]
    scale = gather(stack.base, windows, horizon, p=inner, outputs=outputs).scale
    return stack, gather(stack.model, windows, horizon, scale, stack.p, outputs)


@dataclass(frozen=True)
class _Search:
    """One run of the selection."""

    evidence: Evidence
    candidates: tuple[Candidate, ...]
    settings: Selection
    whole: Evidence
    """Also what a state is estimated by."""

    def run(self, start: Scored) -> tuple[Stack, float, list[Gain], dict[str, float]]:
        """Climbs the tiers: stack found, its held-out deviation, what terms brought, what was
        tried."""
        now, tier = start, SIMPLE
        level, gains, tried = now.mean, list[Gain](), dict[str, float]()
        while tier <= FREE:
            options = self.options(now, level, tier) if len(gains) < self.settings.most else []
            tried = {_label(o): o.gain for o in options if not o.replaced} | tried
            best = self.confirmed(options)
            if best is None:
                if tier < FREE:
                    now, level = self.pruned(now, level, gains)
                tier += 1
                continue
            now, after = best.scored, level * (1.0 - best.gain)
            if not kind(best.candidate.term.kind).linear:
                again = confirm(refit(now.stack, self.evidence), self.evidence)
                if again.mean < now.mean:
                    now, after = again, after * again.mean / now.mean
            said = _said(now.stack, best.candidate.term, now.detail)
            count, replaced = self.evidence.segments, best.replaced
            gains.append(Gain(best.candidate.term, level, after, count, replaced, said))
            level = after
            tier = SIMPLE if tier < FREE else FREE
        return now.stack, level, gains, tried

    def options(self, now: Scored, level: float, tier: int) -> list[_Option]:
        """Every candidate of the tier, fitted: on top, and in place of simpler terms.

        On top, the terms below were fitted to all rows, so the comparison is with the stack's
        deviation on the rows that it was fitted to; in their place, with its held-out deviation.
        """
        fitted = self.evidence.deviations(self.evidence.residual(now.stack.model, now.stack.p))
        found = []
        for candidate in (c for c in self.candidates if c.tier == tier):
            if tier == FREE and any(
                part.term.kind == candidate.term.kind
                and part.term.channel == candidate.term.channel
                for part in now.stack.parts
            ):
                continue
            simpler = [
                k for k, part in enumerate(now.stack.parts)
                if part.term.kind in candidate.replaces
                and part.term.channel == candidate.term.channel
            ]  # fmt: skip
            itself = candidate.term.kind in candidate.replaces and any(
                now.stack.parts[k].term.kind == candidate.term.kind for k in simpler
            )
            if not itself:  # else it takes its own place
                top = fit_candidate(now.stack, candidate, self.evidence)
                found.append(_compared(candidate, (), fitted, top))
            if simpler:
                bare = now.stack
                for k in reversed(simpler):
                    bare = bare.without(k)
                terms = tuple(now.stack.parts[k].term for k in simpler)
                instead = fit_candidate(bare, candidate, self.evidence)
                before = now.deviations * (level / max(now.mean, TINY))
                found.append(_compared(candidate, terms, before, instead))
        return found

    def confirmed(self, options: Sequence[_Option]) -> _Option | None:
        """The best option whose gain stands when it is fitted anew without each fold."""
        rest = list(options)
        while (best := _best(rest, self.settings)) is not None and best.scored.free is not None:
            again = confirm(best.scored, self.evidence)
            at = next(i for i, option in enumerate(rest) if option is best)
            rest[at] = _compared(best.candidate, best.replaced, best.before, again)
        return best

    def pruned(self, now: Scored, level: float, gains: list[Gain]) -> tuple[Scored, float]:
        """Without new terms that no longer pay, and plain where a richer kind does not pay."""
        new, rule = {id(g.term) for g in gains}, self.settings
        for k in reversed(range(len(now.stack.parts))):
            term, before, old = now.stack.parts[k].term, max(now.mean, TINY), level
            if id(term) not in new:
                continue
            if len(now.stack.parts) > 1:
                less = confirm(refit(now.stack.without(k), self.evidence), self.evidence)
                if now.mean > (1 - rule.gain) * less.mean:
                    now, level = less, level * less.mean / before
                    continue
            if (found := simpler(now, k, self.candidates, self.evidence)) is None:
                continue
            richer = _compared(found[0], (), found[1].deviations, now)
            if richer.gain < rule.gain or richer.sure < rule.sure:
                now, level = found[1], level * found[1].mean / before
                said = _said(now.stack, found[0].term, now.detail)
                gains.append(Gain(found[0].term, old, level, len(now.deviations), (term,), said))
        return now, level

    def scale(self, stack: Stack) -> Vector:
        """What counts as 1 of each output in a trial: of one that is not asked about, very much."""
        asked = asked_of(stack.model, self.settings.outputs)
        return np.where(asked, self.evidence.scale, UNASKED * self.evidence.scale)

    def proposal(self, form: Form, stack: Stack) -> Proposal:
        """The outcome as data."""
        start = confirm(refit(stack, self.evidence), self.evidence)
        best, after, gains, tried = self.run(start)
        before = start.mean
        kept = tuple(g for g in gains if any(g.term is part.term for part in best.parts))
        new = {id(g.term) for g in kept}
        few = [k for k, part in enumerate(best.parts) if id(part.term) in new and part.few]
        best = unmoved(best, stack, self.evidence) if kept else best
        best, after, few = (best, after, few) if kept else (stack, before, [])
        best, taken = plainest(best, few, self.settings.numbers, self.evidence)
        kept = tuple(g for g in kept if any(g.term is part.term for part in best.parts))
        best = started(best, self.whole) if kept and self.evidence.observes else best
        return Proposal(
            Form(tuple(part.term for part in best.parts), form.variant),
            best.model.parameters.names, best.p, before, after, self.scale(best), kept,
            describe(best), tried, tuple(gains), taken=taken,
        )  # fmt: skip


class _Option(NamedTuple):
    scored: Scored
    candidate: Candidate
    replaced: tuple[Term, ...]
    before: Vector
    """Deviation of every segment without it."""
    gain: float
    """Relative gain of the mean."""
    sure: float
    """Mean gain of a segment in its standard errors."""


def _compared(
    candidate: Candidate, replaced: tuple[Term, ...], before: Vector, after: Scored
) -> _Option:
    paired = before - after.deviations
    error = float(paired.std()) / np.sqrt(len(paired))
    gain = 1.0 - after.mean / max(mean_deviation(before), TINY)
    sure = float(paired.mean()) / max(error, TINY)
    if len(paired) < MANY:  # the scatter is known badly: the deviate of equal chance under a normal
        sure = -float(scipy.special.ndtri(scipy.special.stdtr(len(paired) - 1, -sure)))
    return _Option(after, candidate, replaced, before, gain, sure)


def _best(options: Sequence[_Option], settings: Selection) -> _Option | None:
    """The largest gain that is sure; of near equals the one with the fewest numbers."""
    paying = [
        o
        for o in options
        if o.gain >= settings.gain and o.sure >= (SWAP if o.replaced else settings.sure)
    ]
    most = max((o.gain for o in paying), default=0.0)
    near = [o for o in paying if 1.0 - o.gain <= (1.0 + NEAR) * (1.0 - most)]
    return min(near, key=lambda o: (len(o.candidate.low), -o.gain), default=None)


def _said(stack: Stack, term: Term, detail: str) -> str:
    """The sentence about a term just found, and how its fit was chosen."""
    said = next(
        s for s, part in zip(describe(stack), stack.parts, strict=True) if part.term is term
    )
    return f"{said} ({detail})" if detail else said


def _label(option: _Option) -> str:
    return " ".join(p for p in option.candidate.key if p)
