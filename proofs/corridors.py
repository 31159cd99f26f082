"""The way through a corridor that looks alike all along: `python -m proofs.corridors [SEEDS]`.

31 m of a bare corridor (`planted/corridors.py`), its ends out of the lidar's sight, by wheels that
tell 2 % too much. Nothing but they says how far it went. Asked in each drive: no slip is told, each
pose is off by no more than three of its standard deviations (or 5 cm), and none by 0.6 m.
"""

from __future__ import annotations

import sys

import numpy as np

from evertwin.features.maps.mapping import mapped
from evertwin.features.scans.poses import Fix
from planted.corridors import WAY, driven
from proofs._verdict import ended


def main(seeds: int = 10) -> int:
    """Exit code 0 if all that is asked was reached."""
    slips, widths, most, least = 0, [], [], len(WAY)
    for seed in range(seeds):
        found = mapped(driven(seed)).poses
        told = found.fix == Fix.MATCHED
        off = np.abs(found.pose[told, 0] - (WAY - WAY[0])[told])
        allowed = np.maximum(3.0 * np.sqrt(found.covariance[told, 0, 0]), 0.05)
        slips, least = slips + int(found.slip.any()), min(least, int(told.sum()))
        widths.append(float(np.max(off / allowed)))
        most.append(float(off.max()))
    sys.stdout.write(
        f"{seeds} drives: at least {least} of {len(WAY)} poses told, off by {max(most):.2f} m at "
        f"most, {max(widths):.2f} of what is allowed, {slips} with slip\n"
    )
    return ended({
        "poses are told": least > 100, "no slip": slips == 0,
        "as sure as they say": max(widths) < 1.0, "off by less than 0.6 m": max(most) < 0.6,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2])))
