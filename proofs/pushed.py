"""Pushes told from lying sensors, live: `python -m proofs.pushed [SEEDS]`.

The embedded arm runs beside `twins/arm_live.toml` as its controller gives it, ten times a second.
After 300 s, in which the twin tunes itself, something befalls the arm every 70 s, drawn anew for
each seed, eight a seed: a push on one of the three large joints (90 to 200 Nm, 0.3 to 1 s), or a
torque sensor of any joint that freezes or that is off for 3 to 10 s (by 3 to 8 times what the
joint's friction is). A push is right where `external` is told and neither a sensor is accused nor
another version goes live; a sensor is right where `measurement_error` names it. Nothing but the
torque says that a joint's torque is off for a while: told of that joint otherwise (`external`,
`overruled`, `not_judged`), with no version gone live, it counts as "sensor or machine".
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import RunResult
from evertwin.fold import Event
from planted.twins import opened
from planted.worlds import record_live
from proofs._verdict import ended

BEGIN, EVERY, EACH = 300.0, 70.0, 8
RATE = 10.0
FRICTION = (12.0, 14.0, 9.0, 3.0, 3.0, 2.5)
"""About [Nm]: what a bias is drawn by."""
BOTH = "sensor or machine"
KINDS = ("push", "bias", "freeze")


class Act(NamedTuple):
    """What befalls the arm."""

    at: float
    kind: str
    signal: str
    lasts: float
    order: str


def acts(seed: int) -> list[Act]:
    """Drawn for one seed."""
    rng, found = np.random.default_rng(seed), []
    for k in range(EACH):
        at = BEGIN + EVERY * k + rng.uniform(0.0, 20.0)
        kind = KINDS[k % 3] if k else "push"
        way = rng.choice((-1.0, 1.0))
        if kind == "push":
            axis, lasts = int(rng.integers(1, 4)), rng.uniform(0.3, 1.0)
            order = f"push.{axis}={way * rng.uniform(90.0, 200.0):.0f}"
        else:
            axis, lasts = int(rng.integers(1, 7)), rng.uniform(3.0, 10.0)
            size = way * rng.uniform(3.0, 8.0) * FRICTION[axis - 1]
            order = f"bias.tau{axis}={size:.1f}" if kind == "bias" else f"freeze.tau{axis}=1"
        text = f"{at:.1f}:{order} for={lasts:.1f}"
        found.append(Act(round(at, 1), kind, f"tau{axis}", lasts, text))
    return found


def verdict(act: Act, events: list[Event]) -> str:
    """What was told from its begin until before the next one."""
    first = act.at * RATE
    near = [e for e in events if first <= e.row < first + 0.7 * EVERY * RATE]
    kinds = Counter(e.kind for e in near)
    accused = {e.signal for e in near if e.kind == "measurement_error"}
    told = {e.kind for e in near if act.signal in (e.signal, *e.evidence.get("outputs", ()))}
    if act.kind == "push":
        good = kinds["external"] and not accused and not kinds["promoted"]
    else:
        good = act.signal in accused
    if good:
        return "right"
    named = told & {"external", "overruled", "not_judged"} and not kinds["promoted"]
    if act.kind == "bias" and named and not accused:
        return BOTH
    return ", ".join(f"{e.kind} {e.signal}" for e in near) or "nothing"


def of_seed(seed: int, folder: Path) -> tuple[RunResult, list[Act]]:
    """One arm and its twin."""
    drawn, file = acts(seed), folder / f"{seed}.csv"
    length = BEGIN + EVERY * EACH
    files = record_live("arm", file, length, *(one.order for one in drawn), seed=seed)
    with opened("arm_live") as twin:
        return twin.run(files), drawn


def main(seeds: int = 4) -> int:
    """Exit code 0 where each is told by its right name, or that it cannot be told."""
    told: Counter[tuple[str, str]] = Counter()
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as name:
            result, drawn = of_seed(seed, Path(name))
        for act in drawn:
            found = verdict(act, list(result.events))
            known = found in ("right", BOTH)
            told[act.kind, found if known else "wrong"] += 1
            if found != "right":
                print(f"   seed {seed} {act.order}: {found}")
    for (kind, found), count in sorted(told.items()):
        print(f"{kind}: {count} {found}")
    wrong = sum(count for (_, found), count in told.items() if found == "wrong")
    return ended({"each is told by its name": wrong == 0})


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
