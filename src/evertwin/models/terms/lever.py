"""The lever arm of a pose: a marker, an antenna, a map's frame that sits off the point about which
the base moves.

The base moves as the model says about its own point (the middle of an axle, the centre of its
wheels); the pose that is measured lies ``ahead`` before and ``aside`` to the left of it, so that in
a turn it moves sideways, too:

    position = point + R(heading)·(ahead, aside)

exact for any base. Tracks that turn about a point off their middle look the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import SIMPLE, Candidate, Functions, Intervals
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.of_pose import PoseTerm, sized, way
from evertwin.models.terms.rows import Rows


def after(at: Any, dt: float, p: Any, x: Any, ahead: Any, y: Any) -> int:
    """What the turn of a row adds to the way of the pose."""
    own = placed(at)
    c = own.channel
    cosine = math.cos(ahead[c + 2]) - math.cos(x[c + 2])
    sine = math.sin(ahead[c + 2]) - math.sin(x[c + 2])
    ahead[c] += p[0] * cosine - p[1] * sine
    ahead[c + 1] += p[0] * sine + p[1] * cosine
    y[own.extra], y[own.extra + 1] = ahead[c], ahead[c + 1]
    return 0


class Lever(PoseTerm):
    """See the module.

    >>> KIND.say(Term("lever", "*"), (0.2, -0.04), "m", {})
    'pose: measured 0.2 m ahead and 0.04 m to the right of the point about which the base turns'
    """

    kind = "lever"
    alike = "a base that turns about a point so far off its middle would look the same"
    functions = Functions(after=after)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        return [Parameter("ahead", 0.0, "m"), Parameter("aside", 0.0, "m")]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        """From the point itself: the way over a horizon sets the scale."""
        size = 0.1 * way(rows)
        if size > 0.0:
            yield Candidate(
                Term(self.kind, "*"), SIMPLE, ((0.0, 0.0),), (-math.inf,) * 2, (math.inf,) * 2,
                (size, size),
            )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        ahead, aside = values
        parts = [
            f"{sized(name, value, 'm', intervals)} {where}"
            for name, value, where in (
                ("ahead", ahead, "ahead" if ahead > 0.0 else "behind"),
                ("aside", aside, "to the left" if aside > 0.0 else "to the right"),
            ) if value
        ]  # fmt: skip
        return (
            f"pose: measured {' and '.join(parts) or 'not off'} of the point about which the base "
            "turns"
        )


KIND = Lever()
