"""Where the embedded robot truly is, as it says it by MQTT: only to score the pose that its twin
tells from scans.

>>> found = off_by(np.arange(2), np.zeros((2, 3)), np.arange(2), np.full((2, 3), 0.01))
>>> [round(one, 4) for one in found]
[0.0141, 0.01]
"""

from __future__ import annotations

import numpy as np

from evertwin.signals.planar import wrapped
from evertwin.sources.live.contract import LiveSource
from evertwin.sources.live.registry import open_live
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.types import Float64, Int64

POSE = SourceSpec(
    "pose",
    {n: ChannelSpec(n, unit) for n, unit in (("x", "cm"), ("y", "cm"), ("heading", "rad"))},
    time=TimeSpec("t", "s"),
)  # fmt: skip

Poses = Float64[np.ndarray, "n 3"]


def truth_at(port: int) -> LiveSource:
    """The robot's true pose by the broker at a port of this computer; `open` connects."""
    settings = {
        "source": "pose", "protocol": "mqtt", "port": port, "topic": "robot/pose",
        "sequence": "seq", "publisher": "session", "version": 3,
    }  # fmt: skip
    return open_live(settings, POSE)


class Truth:
    """What came so far.

    >>> Truth().score([0], [[0.0, 0.0, 0.0]]) is None
    True
    """

    def __init__(self) -> None:
        self._t: list[Int64[np.ndarray, " n"]] = []
        self._v: list[Poses] = []

    async def listen(self, source: LiveSource) -> None:
        """Keeps what comes, until it is cancelled."""
        async for chunk in source.chunks():
            self._t.append(chunk.t)
            self._v.append(chunk.v)

    def score(self, t: list[int], poses: list[list[float | None]]) -> tuple[float, float] | None:
        """`off_by` of poses at stamps [ns]; None: nothing to compare."""
        if not self._t or not t:
            return None
        told = np.array(poses, dtype=np.float64).reshape(-1, 3)
        return off_by(np.array(t), told, np.concatenate(self._t), np.concatenate(self._v))


def off_by(
    t: Int64[np.ndarray, " n"], poses: Poses, true_t: Int64[np.ndarray, " m"], truth: Poses
) -> tuple[float, float] | None:
    """How far poses are off the truth at the same stamps: rms of the place [m], of the heading
    [rad]; None: there are none."""
    _, mine, there = np.intersect1d(t, true_t, return_indices=True)
    off = poses[mine] - truth[there]
    off = off[np.isfinite(off).all(axis=1)]
    if not len(off):
        return None
    place = float(np.sqrt(np.mean(off[:, 0] ** 2 + off[:, 1] ** 2)))
    return place, float(np.sqrt(np.mean(wrapped(off[:, 2]) ** 2)))
