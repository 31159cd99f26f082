"""Odometry, gyro and the poses of scans as one pose: an error-state Kalman filter in the plane.

The state is the pose, the gyro's bias b and the scale s of the wheels' way. What moves is known by
its steps, so the filter carries the error of the state alone (x, y, heading, b, s):

    heading ← heading + turn − b dt        the turn of the gyro; without one, of the wheels
    (x, y)  ← (x, y) + s R(heading) (dx, dy)

Wheels err in proportion to their way, at a rate that the innovations themselves tell
(`Belief.rate`; after Mehra, IEEE Trans. Automatic Control 15, 1970): where poses of scans keep
coming as expected it shrinks, where they do not it grows. One that is out of all proportion makes
the belief as wide as it shows; along the way it is *slip*: the scale is then open, so that the
scans tell it.

>>> at = Belief.at_rest(0, np.zeros(3), np.eye(3) * 1e-6)
>>> ahead = predicted(at, Step(10**9, np.array([1.0, 0.0, 0.0]), np.nan))
>>> seen = measured(ahead, Sighting(np.array([0.6, 0.0, 0.0]), np.eye(3) * 1e4))
>>> seen.belief.pose.round(2).tolist(), seen.slip, seen.belief.scale < 0.8
([0.6, 0.0, 0.0], True, True)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from evertwin.signals.planar import wrapped
from evertwin.types import Float64

WAY, ASIDE = 0.02, 0.01
"""Error of the wheels after a metre: along and across (m/√m)."""
SCALED = 0.02
"""How much the scale of the way may change in a metre (1/√m)."""
TURNING, ALONG = 0.05, 0.01
"""Error of the wheels' turn after a radian (rad/√rad) and a metre (rad/√m)."""
GYRO, DRIFTING = 0.003, 2e-4
"""Error of the gyro's angle (rad/√s), and change of its bias (rad/s/√s)."""
BIAS, SCALE = 0.02, 0.05
"""Spread of bias [rad/s] and scale before anything is known."""
ENDS = 0.5
"""How likely slip ends in a metre (1/m)."""
LONG = 20.0
"""Way in which a scale becomes the usual one [m]."""
OPEN = 0.3
"""Spread of the scale once the wheels slip."""
LIMIT = 16.27
"""Square of an innovation over its covariance that one in a thousand of three exceeds."""
ALONE = 10.83
"""The same of one."""
LEARNS = 0.1
"""How much one innovation tells of the error's rate."""
FIRST = 4.0
"""Rate before anything is known."""
RATES = (0.1, 100.0)
"""Least and largest rate, as a factor on variances."""
UNTOLD = 1e-6
"""Information along a direction, over that across it, up to which a scan leaves it open."""
WIDEST = 10.0
"""Spread of a place from which on it is as good as unknown: surprises make it no wider [m]."""
CARELESS = 1e-6
"""Information where there is none."""


class Belief(NamedTuple):
    """What is known of a machine's motion. See the module for an example."""

    t: int
    """[ns]"""
    pose: Float64[np.ndarray, " 3"]
    """x, y [m], heading [rad, not wrapped]."""
    bias: float
    """Of the gyro [rad/s]."""
    scale: float
    """Way of the machine over that of its wheels."""
    covariance: Float64[np.ndarray, "5 5"]
    """Of the errors of x, y, heading, bias and scale."""
    rate: float
    """Variance of the wheels' error over what is usual."""
    usual: float = 1.0
    """The scale, when the wheels do not slip."""

    @classmethod
    def at_rest(
        cls, t: int, pose: Float64[np.ndarray, " 3"], covariance: Float64[np.ndarray, "3 3"]
    ) -> Belief:
        """At a pose, with wheels and a gyro of which nothing is known."""
        whole = np.diag([0.0, 0.0, 0.0, BIAS * BIAS, SCALE * SCALE])
        whole[:3, :3] = covariance
        return cls(t, pose.copy(), 0.0, 1.0, whole, FIRST)

    def moved(
        self, t: int, pose: Float64[np.ndarray, " 3"], covariance: Float64[np.ndarray, "3 3"]
    ) -> Belief:
        """At another pose, by other means, with the same wheels and gyro."""
        whole = np.zeros((5, 5))
        whole[:3, :3], whole[3:, 3:] = covariance, self.covariance[3:, 3:]
        return self._replace(t=t, pose=pose.copy(), covariance=whole)


class Step(NamedTuple):
    """What wheels and gyro say of a while.

    >>> Step(10**9, np.zeros(3), 0.1).gyro
    0.1
    """

    lasts: int
    """[ns]"""
    wheels: Float64[np.ndarray, " 3"]
    """In the frame of its start (m, m, rad)."""
    gyro: float
    """Turn by the gyro [rad]; NaN without one."""

    def share(self, part: float) -> Step:
        """The first part of it."""
        return Step(round(part * self.lasts), part * self.wheels, part * self.gyro)


class Sighting(NamedTuple):
    """A pose by a scan.

    >>> Sighting(np.zeros(3), np.eye(3)).information[0, 0]
    np.float64(1.0)
    """

    pose: Float64[np.ndarray, " 3"]
    information: Float64[np.ndarray, "3 3"]
    """Of the scan alone: singular where it leaves a direction open."""


class Measured(NamedTuple):
    """What a pose by a scan makes of a belief.

    >>> Measured._fields
    ('belief', 'slip', 'square')
    """

    belief: Belief
    slip: bool
    square: float
    """Of the innovation over its covariance; 3 on average if all is as believed."""


def predicted(belief: Belief, step: Step) -> Belief:
    """After a step."""
    dt, (dx, dy, turned) = 1e-9 * step.lasts, step.wheels
    blind = math.isnan(step.gyro)
    turn = turned if blind else step.gyro - belief.bias * dt
    heading = belief.pose[2] + 0.5 * (turn - turned)  # the wheels' own turn is in dx, dy
    c, s = math.cos(heading), math.sin(heading)
    ox, oy = c * dx - s * dy, s * dx + c * dy
    x, y = belief.scale * ox, belief.scale * oy
    f = np.eye(5)
    f[0, 2], f[1, 2] = -y, x
    f[0, 4], f[1, 4] = ox, oy
    if not blind:
        f[2, 3] = -dt
    way = math.hypot(dx, dy)
    ahead = np.array([c, s]) if way == 0 else np.array([ox, oy]) / way
    across = np.array([-ahead[1], ahead[0]])
    q = np.zeros((5, 5))
    along, aside = belief.rate * WAY * WAY * way, belief.rate * ASIDE * ASIDE * way
    q[:2, :2] = along * np.outer(ahead, ahead) + aside * np.outer(across, across)
    q[2, 2] = GYRO * GYRO * dt
    if blind:
        q[2, 2] = belief.rate * (TURNING * TURNING * abs(turned) + ALONG * ALONG * way)
    q[3, 3], q[4, 4] = DRIFTING * DRIFTING * dt, SCALED * SCALED * way
    q[4, 4] += ENDS * way * max((belief.scale - belief.usual) ** 2 - SCALE * SCALE, 0.0)
    return belief._replace(
        t=belief.t + step.lasts,
        usual=belief.usual + min(way / LONG, 1.0) * (belief.scale - belief.usual),
        pose=belief.pose + np.array([x, y, turn]),
        covariance=f @ belief.covariance @ f.T + q,
    )


def _error(sighting: Sighting) -> Float64[np.ndarray, "3 3"]:
    return np.asarray(np.linalg.inv(sighting.information + CARELESS * np.eye(3)))


def _given_open(p: np.ndarray, sighting: Sighting) -> np.ndarray:
    """A belief's covariance, had the direction that a scan leaves open been known.

    Which direction that is varies a little from scan to scan. Taken at its word, the place along a
    corridor would be told by where its walls' directions meet, which is noise.
    """
    values, directions = np.linalg.eigh(sighting.information[:2, :2])
    along = p[:, :2] @ directions[:, 0]
    spread = float(directions[:, 0] @ along[:2])
    if values[0] > UNTOLD * values[1] or spread <= 0:
        return p
    return np.asarray(p - np.outer(along, along) / spread)


def _corrected(belief: Belief, sighting: Sighting) -> tuple[Belief, float]:
    """The Kalman filter's update, and the square of the innovation."""
    p, r = belief.covariance, _error(sighting)
    off = sighting.pose - belief.pose
    off[2:] = wrapped(off[2:])
    told = _given_open(p, sighting)
    gain = np.linalg.solve(told[:3, :3] + r, told[:3]).T
    square = float(off @ np.linalg.solve(p[:3, :3] + r, off))
    k = np.eye(5)
    k[:, :3] -= gain
    covariance = k @ p @ k.T + gain @ r @ gain.T  # Joseph's form stays positive
    error = gain @ off
    corrected = belief._replace(
        pose=belief.pose + error[:3], bias=belief.bias + float(error[3]),
        scale=belief.scale + float(error[4]), covariance=covariance,
    )  # fmt: skip
    return corrected, square


def measured(belief: Belief, sighting: Sighting, way: float = 1.0) -> Measured:
    """With the pose of a scan, the wheels having gone ``way`` [m] since the one before."""
    found, square = _corrected(belief, sighting)
    slip = False
    if square > LIMIT:
        ahead = np.array([math.cos(belief.pose[2]), math.sin(belief.pose[2])])
        off, s = sighting.pose - belief.pose, belief.covariance[:3, :3] + _error(sighting)
        slip = way > 0 and float(ahead @ off[:2]) ** 2 > ALONE * float(ahead @ s[:2, :2] @ ahead)
        wider = np.eye(5)
        place = math.sqrt(belief.covariance[0, 0] + belief.covariance[1, 1])
        wider[:3, :3] *= min(math.sqrt(square / 3.0), max(WIDEST / max(place, 1e-9), 1.0))
        p = wider @ belief.covariance @ wider
        turn = float(wrapped(off[2:])[0])
        p[3, 3] += BIAS * BIAS * (turn * turn > ALONE * s[2, 2])  # or the gyro's bias has changed
        if slip:
            opened = np.array([way * ahead[0], way * ahead[1], 0.0, 0.0, 1.0])
            p += OPEN * OPEN * np.outer(opened, opened)
        found, _ = _corrected(belief._replace(covariance=p), sighting)
    told = min(square / 3.0, 10.0)
    rate = belief.rate * math.exp(LEARNS * (told - 1.0)) if way > 0 else belief.rate
    rate = min(max(rate, RATES[0]), RATES[1])
    return Measured(found._replace(rate=rate), slip, square)
