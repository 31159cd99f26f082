"""The way along a corridor, which scans left open: how far it errs, and what told it later."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from evertwin.features.maps.pose_graph import Edge, turned
from evertwin.features.scans.poses import Fix, Poses
from evertwin.signals.planar import between, compose
from evertwin.types import Float64

SURE, OPEN = 0.2, 0.5
"""Spread below which a place is sure, and above which it is none [m]."""


def steps_between(poses: Poses, keys: Sequence[int] | np.ndarray) -> list[Edge]:
    """From each keyframe to the next, as they were followed.

    Where no pose was told between them, as the first one's place was less and less sure, its error
    grows on at the pace at which it had since it was sure.
    """
    out, lost = [], np.cumsum(poses.fix == Fix.LOST)
    sure = np.trace(poses.covariance[:, :2, :2], axis1=1, axis2=2) < SURE * SURE
    for n, (a, b) in enumerate(pairwise(keys)):
        gap, since = int(lost[b] - lost[a]), a - np.flatnonzero(sure[: a + 1])[-1:].sum()
        longer = 1 + gap / max(since, 1) if gap else 0.0
        spread = poses.covariance[b] + longer * longer * poses.covariance[a]
        covariance = turned(spread, poses.pose[b, 2])
        out.append(Edge(n, n + 1, between(poses.pose[a], poses.pose[b]), covariance))
    return out


def evened(poses: Poses, wheels: Float64[np.ndarray, "n 3"] | None) -> Poses:
    """Poses whose place was not sure along a bare corridor, moved by what the next sure one tells.

    Its innovation along the open direction goes back over them, to each as much as its variance
    then was of that before the innovation: the smoother of a random walk (Rauch, Tung and Striebel,
    AIAA Journal 3(8), 1965). What was expected there is told by the ``wheels``, or the last step
    again. Places that were too unsure to be told are told where less than `OPEN` is left.
    """
    unsure = (poses.fix == Fix.LOST) & np.isfinite(poses.sighted[:, 0])
    pose = np.where(unsure[:, None], poses.sighted, poses.pose)
    spread, fix = poses.covariance.copy(), poses.fix.copy()
    spread[unsure] = np.linalg.inv(poses.information[unsure])
    place = spread[:, :2, :2].copy()
    known = np.flatnonzero(unsure | (fix == Fix.MATCHED))
    firm = known[np.trace(place[known], axis1=1, axis2=2) < SURE * SURE]
    for a, b in pairwise(firm):
        open_ = known[(known > a) & (known < b)]
        if not len(open_) or poses.segment[a] != poses.segment[b]:
            continue
        before, last = (a, *open_)[-2:]
        if wheels is not None and np.isfinite(wheels[[last, b]]).all():
            usual = compose(pose[last], between(wheels[last], wheels[b]))[:2]
        else:
            usual = pose[last, :2] + (pose[last, :2] - pose[before, :2]) / (last - before) * (
                b - last
            )
        along = np.linalg.eigh(place[last])[1][:, 1]
        variance = np.einsum("i,nij,j->n", along, place[[a, *open_]], along)
        ahead = variance[-1] + max(variance[-1] - variance[-2], 0.0)
        back = np.minimum(variance[1:] / ahead, 1.0)
        pose[open_, :2] += (back * float(along @ (pose[b, :2] - usual)))[:, None] * along
        spread[open_, :2, :2] -= (back * variance[1:])[:, None, None] * np.outer(along, along)
        now = unsure[open_] & (np.trace(spread[open_, :2, :2], axis1=1, axis2=2) < OPEN * OPEN)
        fix[open_[now]] = Fix.MATCHED if len(open_) == b - a - 1 else Fix.LOST
    spread = np.where(unsure[:, None, None], spread, poses.covariance)
    spread[fix == Fix.LOST], pose[fix == Fix.LOST] = np.nan, np.nan
    return poses._replace(pose=pose, covariance=spread, fix=fix)
