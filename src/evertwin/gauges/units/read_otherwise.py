"""Would rows that numbers were tuned on fit far better, had a channel been read otherwise?"""

from __future__ import annotations

from evertwin.fold import Windows
from evertwin.gauges.rows.sensor_change import unmeasured
from evertwin.gauges.units.misread import likeliest, seen, total
from evertwin.gauges.units.turned import Numbered, liveliest, turned
from evertwin.setup.setup import Setup

CLEARLY = 2.0
"""Times the squared mismatch that a reading leaves with numbers that nobody tuned, which tuned ones
leave at least."""


@unmeasured()
def read_otherwise(setup: Setup, told: Numbered, tuned: Numbered, windows: Windows) -> str:
    """What a channel looks like, and what to do about it; empty where tuning does as well.

    Args:
        setup: of the twin; of a static map nothing is said: tuning takes up a unit.
        told: model and parameters as they were.
        tuned: the same as they were tuned.
        windows: rows, of which those that say most are looked at.
    """
    if setup.static or not windows:
        return ""
    rows = liveliest(windows)
    found = likeliest(setup, *told, rows)
    if found:
        left = total(seen(setup, *told, [found[0].undone(one) for one in rows]).mismatch)
        if total(seen(setup, *tuned, rows).mismatch) >= CLEARLY * left:
            readings = ", or ".join(one.said for one in found)
            return f"{readings}: read so, far less is left; correct the twin file or the recording"
    angle = turned(setup, (told, tuned), windows)
    return angle.told(setup) if angle else ""
