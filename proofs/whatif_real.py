"""What if, on real machines that then did it: `python -m proofs.whatif_real [MACHINE ...]`.

Needs EVERTWIN_DATA. A pair is two recordings of one machine: a twin knows the first, `Twin.whatif`
is asked about the second before it is seen, and what was then measured is held against the answer:
of each output the largest size and the rms, each with its interval of 95 %.

* *load*: `twins/ur10e.toml`, commissioned on February's first runs and tuned on the motion without
  a load of 31 January; what if the tip carries 3.05 kg, whose centre nobody says.
* *autumn*: the same, tuned anew on each recording of autumn 2019 in order of date; what if it
  drives the path of the next one. Such pairs differ in the path, and in friction, which is tuned.
* *speeds*: the same as commissioned, and the first half of a recording of one joint at several
  speeds; what if it drives the path of the second half.

  The arm's recordings are those of its twin file and the newest one.
* *husky*, *warthog*: `twins/drive_*.toml` run over steady windows of even steps; what if it drives
  the commands of an odd step, `STEPS` of them spread over the recording.

Asked: inside in 90 % or more; "beyond what was recorded" said of at most 20 % of the pairs, and of
none of autumn; the mean half width at most 3 times the mean error.
"""

from __future__ import annotations

import itertools
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.ahead.spec import LoadSpec, PathSpec, ScenarioSpec
from evertwin.ahead.whatif import WhatIf
from evertwin.fold import Block, Mark
from planted.twins import opened, planned
from proofs._verdict import ended, no_data
from proofs.drives import steps
from proofs.seasons import COMMISSIONED, date, files

STEPS = 60
"""Windows of a base that are asked about."""
MASS = 3.05
BASES = ("husky", "warthog")
BEYOND = "beyond what was recorded"


class Pair(NamedTuple):
    """One output of a pair, its rms or its largest size: what was told, and what came."""

    machine: str
    name: str
    what: str
    told: float
    low: float
    high: float
    came: float
    beyond: bool

    @property
    def output(self) -> str:
        """Its name alone."""
        return self.name.rpartition(" ")[2]

    @property
    def half(self) -> float:
        """Half the interval's width."""
        return (self.high - self.low) / 2

    @property
    def off(self) -> float:
        """By what the answer is off."""
        return abs(self.told - self.came)

    @property
    def inside(self) -> bool:
        """Does the interval hold what came?"""
        return self.low <= self.came <= self.high


def judged(machine: str, name: str, found: WhatIf, rows: Block) -> Iterator[Pair]:
    """An answer beside the rows that came; a state goes on from where the machine stood."""
    beyond = any(note.startswith(BEYOND) for note in found.notes)
    for k, (output, size) in enumerate(found.after.outputs.items()):
        known = rows.mark[:, rows.u.shape[1] + k] == Mark.OK
        y = rows.y[known & np.isfinite(rows.y[:, k]), k]
        if machine in BASES:
            y = np.unwrap(y) if output == "heading" else y
            y = y - y[0] + found.after.y[0, k]
        one = f"{name} {output}"
        rms, peak = float(np.sqrt(np.mean(y**2))), float(np.abs(y).max())
        yield Pair(machine, one, "rms", size.rms, *size.rms95, rms, beyond)
        yield Pair(machine, one, "peak", size.peak, *size.peak95, peak, beyond)


def driven(twin: Twin, rows: Block, known: list[str], folder: Path) -> WhatIf:
    """What if the machine drove the path of these rows?"""
    inputs = planned(twin.model, folder / "path.csv", rows.u, rows.dt)
    return twin.whatif(ScenarioSpec("driven", path=PathSpec(file=str(inputs))), known)


def tuned(twin: Twin, recordings: list[str]) -> None:
    """What a fit finds goes live."""
    version = twin.keep(twin.fit(recordings))
    twin.promote(version.number, "tuned")


def arm(folder: Path) -> Twin:
    """Commissioned on the first runs of February."""
    known = [str(file) for file in files("identification") if date(file) in COMMISSIONED]
    twin = opened("ur10e")
    tuned(twin, known)
    return twin


def own(newest: str) -> list[str]:
    """The arm's recordings."""
    return [*map(str, files("identification")), newest]


def load(folder: Path) -> Iterator[Pair]:
    """One pair, six joints."""
    without, loaded = (
        str(next(f for f in files("load_pair") if f.stem.endswith(f"-{kind}")))
        for kind in ("unload", "load")
    )
    with arm(folder) as twin:
        tuned(twin, [without])
        found = twin.whatif(ScenarioSpec("load", load=LoadSpec(MASS)), own(without))
        yield from judged("load", "3.05 kg", found, twin.blocks([loaded])[0])


def autumn(folder: Path) -> Iterator[Pair]:
    """Each recording of three seconds or more, from the one before."""
    with arm(folder) as twin:
        known = [(str(f), b[0]) for f in files("autumn") if (b := twin.blocks([f]))]
        known = [(file, rows) for file, rows in known if len(rows.t) > 300]
        for (before, _), (after, rows) in itertools.pairwise(known):
            tuned(twin, [before])
            found = driven(twin, rows, own(before), folder)
            yield from judged("autumn", Path(after).stem[3:], found, rows)


def speeds(folder: Path) -> Iterator[Pair]:
    """Each joint."""
    with arm(folder) as twin:
        for file in files("jointwise"):
            (whole,) = twin.blocks([file])
            half = float(whole.t[-1] - whole.t[0]) * 0.5e-9
            first, second = f"{file}@:{half:g}", f"{file}@{half:g}:"
            rows = twin.blocks([second])[0]
            found = driven(twin, rows, own(first), folder)
            yield from judged("speeds", file.stem[-7:], found, rows)


def base(robot: str) -> Callable[[Path], Iterator[Pair]]:
    """Windows of odd steps."""

    def pairs(folder: Path) -> Iterator[Pair]:
        even, odd = (str(steps(robot, folder, which)) for which in (0, 1))
        with opened(f"drive_{robot}") as twin:
            twin.run([even])
            windows = twin.blocks([odd])
            for k in np.linspace(0, len(windows) - 1, STEPS).astype(int).tolist():
                found = driven(twin, windows[k], [even], folder)
                yield from judged(robot, f"window {k}", found, windows[k])

    return pairs


MACHINES: dict[str, Callable[[Path], Iterator[Pair]]] = {
    "load": load, "autumn": autumn, "speeds": speeds, **{name: base(name) for name in BASES},
}  # fmt: skip


def told(machine: str, found: list[Pair]) -> dict[str, bool]:
    """Prints what was missed, and the counts; relative to what came of the output on the mean."""
    for one in found:
        if not one.inside:
            ends = f"({one.low:.3g} … {one.high:.3g})"
            print(f"   {one.name} {one.what}: {one.told:.3g} {ends}, came {one.came:.3g}")
    demands = {}
    names = dict.fromkeys(one.output for one in found)
    sizes = {name: np.mean([one.came for one in found if one.output == name]) for name in names}
    for what in ("rms", "peak"):
        rows = [one for one in found if one.what == what]
        inside = np.mean([one.inside for one in rows])
        half = np.mean([one.half / sizes[one.output] for one in rows])
        off = np.mean([one.off / sizes[one.output] for one in rows])
        print(f"{machine:8s} {what:4s} {len(rows):3d} answers, inside {inside:4.0%}, half width "
              f"{half:6.1%}, off by {off:6.1%}, ratio {half / off:.1f}")  # fmt: skip
        demands[f"{machine} {what}: 90 % inside"] = bool(inside >= 0.9)
        demands[f"{machine} {what}: half width at most 3 errors"] = bool(half <= 3.0 * off)
    beyond = np.mean([one.beyond for one in found])
    print(f"{machine:8s} beyond what was recorded: {beyond:.0%}", flush=True)
    demands[f"{machine}: beyond in at most 20 %, none of autumn"] = bool(
        beyond <= (0.0 if machine == "autumn" else 0.2)
    )
    return demands


def main(names: list[str]) -> int:
    """Prints each machine; exit code 1 where something asked is missed."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    demands: dict[str, bool] = {}
    for name in names or MACHINES:
        with tempfile.TemporaryDirectory() as folder:
            demands |= told(name, list(MACHINES[name](Path(folder))))
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
