"""What carries a base along whatever it is told: a current under a boat, wind on what flies or
floats, a drifting map.

    dx/dt = ... + x,   dy/dt = ... + y

in the axes of the pose, constant. Told apart from an offset of the speed by headings that differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import SIMPLE, Candidate, Functions, Intervals, told
from evertwin.models.terms.kernel import placed
from evertwin.models.terms.of_pose import PoseTerm, way
from evertwin.models.terms.rows import Rows


def after(at: Any, dt: float, p: Any, x: Any, ahead: Any, y: Any) -> int:
    """The way that a row is carried."""
    own = placed(at)
    c = own.channel
    ahead[c] += p[0] * dt
    ahead[c + 1] += p[1] * dt
    y[own.extra], y[own.extra + 1] = ahead[c], ahead[c + 1]
    return 0


class Current(PoseTerm):
    """See the module.

    >>> KIND.say(Term("current", "*"), (-0.3, 0.1), "m", {})
    'pose: carried by -0.3 m/s in x and 0.1 m/s in y whatever is commanded (a current, wind)'
    """

    kind = "current"
    functions = Functions(after=after)

    def parameters(self, term: Term, unit: str, source: str) -> Sequence[Parameter]:
        return [Parameter("x", 0.0, "m/s"), Parameter("y", 0.0, "m/s")]

    def propose(self, rows: Rows) -> Iterator[Candidate]:
        """From none: the speed sets the scale."""
        size = 0.1 * way(rows) / rows.horizon
        if size > 0.0:
            yield Candidate(
                Term(self.kind, "*"), SIMPLE, ((0.0, 0.0),), (-math.inf,) * 2, (math.inf,) * 2,
                (size, size),
            )  # fmt: skip

    def say(self, term: Term, values: Sequence[float], unit: str, intervals: Intervals) -> str:
        x, y = (told(n, v, "m/s", intervals) for n, v in zip("xy", values, strict=True))
        return f"pose: carried by {x} in x and {y} in y whatever is commanded (a current, wind)"


KIND = Current()
