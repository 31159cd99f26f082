"""What nothing explains is said once of a state of the machine, and again where it is another."""

from __future__ import annotations

from evertwin.loop.decisions.decision import Decision
from evertwin.refit.answer_events import event

from .test_decide import Bench

LIMIT = "(limit 5.0 %), and explains 68 %: the form does not reach it"
"""Of every answer."""


def test_a_deviation_of_other_figures_is_the_same() -> None:
    decision = Decision(Bench().state, [], [])

    def told(output: str, off: float) -> int:
        said = event("abnormal", output, f"tuned, {output} is off by {off} % {LIMIT}", {})
        return len(decision.fresh({"events": [said]}))

    assert [told("tau1", 7.8), told("tau1", 8.25), told("tau1", 10.0)] == [1, 0, 0]
    assert [told("tau2", 8.25), told("tau1", 7.8)] == [1, 1]
    decision.state = decision.state._replace(live=decision.state.live._replace(version=1))
    assert told("tau1", 7.8) == 1
