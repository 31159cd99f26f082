"""Lines that repeat themselves are one; nothing is left out of what a program reads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.config.spec import ModelSpec, PredictionSpec, TwinSpec
from evertwin.fold import Event
from evertwin.outcome.course.summed_up import summed_up
from evertwin.twin import Twin


def events() -> tuple[Event, ...]:
    second = 10**9
    spikes = [
        Event(row, row * second // 10, "measurement_error", "x", "outside the gate", {"cause": c})
        for row, c in ((3, "vote"), (9, "vote"), (12, "frozen"), (20, "vote"), (31, "vote"))
    ]
    decided = [Event(row, row * second // 10, "tuned", "x", "tuned gain", {}) for row in (4, 5, 6)]
    return tuple(sorted((*spikes, *decided), key=lambda one: one.row))


def test_one_line_says_how_often_and_until_when() -> None:
    t = np.arange(60) * 0.1
    spec = TwinSpec("robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0))
    with Twin(spec) as twin:
        run = twin.run({"t": t, "v": np.full(60, 0.2), "x": 0.2 * t})
    result = replace(run, events=events())
    lines = [line for line in result.text(every=True).splitlines() if line.startswith("  row ")]
    assert len(lines) == 5  # four spikes are one line; a frozen sensor and decisions stay
    assert "4 times until row 31 (3.1 s), first: outside the gate" in lines[0]
    assert sum("tuned gain" in line for line in lines) == 3
    assert len(result.to_dict()["events"]) == 8  # type: ignore[arg-type]


def test_two_of_a_kind_stay_two_lines() -> None:
    assert [one.times for one in summed_up(events()[:2])] == [1, 1]
