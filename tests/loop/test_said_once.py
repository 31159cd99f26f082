"""What nothing explains is said once of a state of the machine, and again where it is another."""

from __future__ import annotations

from evertwin import Twin, TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.loop.decisions.decision import Decision
from evertwin.refit.answer_events import event


def test_a_deviation_of_other_figures_is_the_same() -> None:
    said = (
        ("tau1", "tuned, tau1 is off by 7.8 %: the form does not reach it"),
        ("tau1", "tuned, tau1 is off by 8.3 %: the form does not reach it"),
        ("tau2", "tuned, tau2 is off by 8.3 %: the form does not reach it"),
        ("tau1", "tuned, tau1 is off by 7.9 %: the form does not reach it"),
    )
    with Twin(TwinSpec("cart", ModelSpec("robot1d"))) as twin:
        decision = Decision(twin.state, [], [])
    told = [
        decision.fresh({"events": [event("abnormal", *one, {})]}) for one in said
    ]
    assert [len(one) for one in told] == [1, 0, 1, 1]
