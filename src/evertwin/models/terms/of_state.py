"""Terms that act on a state of the model, measured or not."""

from __future__ import annotations

from evertwin.models.contract import Model
from evertwin.models.form import Term
from evertwin.models.terms.contract import CorrectionTerm


class StateTerm(CorrectionTerm):
    """Its channel is a state; where an output shows that state, the output follows.

    >>> StateTerm.rank
    4
    """

    rank = 4

    def channel(self, term: Term, model: Model) -> int:
        return model.states.index(term.channel)

    def unit(self, term: Term, model: Model) -> str:
        return model.states.units[self.channel(term, model)]

    def extra(self, term: Term, model: Model) -> int:
        """The output that shows the state; −1: none."""
        names = model.outputs.names
        return names.index(term.channel) if term.channel in names else -1
