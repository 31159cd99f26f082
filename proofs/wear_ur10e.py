"""Wear of a real arm's joints, semi-synthetic: `python -m proofs.wear_ur10e [PATHS]`.

Needs EVERTWIN_DATA. There is no public recording of a robot joint that wears out. A known growth of
friction is added to the recorded torques of the UR10e, so noise and scatter are real and the truth
is exact (semi-synthetic). A wear path is a series of 60 runs, each one of the nine recorded runs at
random; in one joint friction grows by a linear or exponential law and passes + 50 % at a run
between 45 and 90. In every joint friction is higher after a cold start, × (1 + a·e^(−t/τ)), a 10 to
30 %, τ 20 to 40 min; in the second half of the series the arm starts cold more often, which looks
like growth. From some run on the tip carries up to 4 kg more.

Each run is a recording that `Twin.fit` gets with `twins/ur10e.toml`: friction, offsets and payload
are tuned, the bodies stay as they were fitted to all nine. A joint's indicator is its friction at
0.5 rad/s, and `Twin.life` is asked with `warm_up = "30 min"`: at 50, 70 and 90 % of the worn
joint's life, and of every joint at the end of the series. The dummy knows only the mean life of the
worn joints, and takes every joint for worn.
"""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.fold import Block
from evertwin.models.spec import ParameterSpec
from evertwin.prognosis.laws import Life
from evertwin.prognosis.lives import ComponentLife
from planted.histories import Told, until
from planted.twins import opened, shipped
from proofs._verdict import ended, holds, no_data
from proofs.ur10e import files, fitted

RUNS, LIMIT, SPEED, WARM = 60, 1.5, 0.5, 1800.0
"""Runs of a path; life ends at this share of the friction when new, at this speed [rad/s]; time
constant of warm-up that the twin takes for known [s]."""
CUTS = (0.5, 0.7, 0.9)
PAYLOAD = ("payload.m", "payload.mx", "payload.my", "payload.mz")
TUNED = ("Fv*", "Fc*", "offset*", *PAYLOAD)


class Run(NamedTuple):
    """One recorded run, and what wear and a load of 1 kg would add to its torques."""

    rows: Block
    friction: np.ndarray
    load: np.ndarray


@dataclass(frozen=True)
class Arm:
    """The arm as fitted to all runs."""

    twin: Twin
    runs: list[Run]
    folder: Path

    def tuned(self, run: Run, added: np.ndarray) -> tuple[np.ndarray, float]:
        """Friction of each joint at `SPEED` and the payload, as the twin finds them in a run."""
        (scale,) = ([c.scale for n, c in s.channels.items() if n[:3] == "tau"]
                    for s in self.twin.spec.source)  # fmt: skip
        t = (run.rows.t - run.rows.t[0])[:, None] * 1e-9
        table = np.hstack([t, run.rows.u[:, :12], (run.rows.y + added) / np.array(scale)])
        file = self.folder / "run.csv"
        np.savetxt(file, table, fmt="%.9g", delimiter=",")
        fit = self.twin.fit(file).fit
        return np.array([fit[f"Fc{k}"] + SPEED * fit[f"Fv{k}"] for k in range(1, 7)]), fit[
            "payload.m"
        ]


def prepared(folder: Path) -> Arm:
    """The arm, and all its runs."""
    options = {**shipped("ur10e").model.options, "law": "tanh"}
    plain = {"ladder": (), "causes": {}, "states": {}, "editable": ("Ia*", *TUNED[:3], "*_link.*")}
    found = fitted(files("identification"), model={"options": options}, tuning=plain).parameters
    values = {item.name: ParameterSpec(value=item.value) for item in found}
    twin = opened(
        "ur10e", model={"options": options, "parameters": values},
        tuning={"ladder": (), "causes": {}, "states": {}, "editable": TUNED},
    )  # fmt: skip
    model, p = twin.model, twin.model.parameters.values
    loaded = model.parameters.with_values({"payload.m": 1.0, "payload.mz": 0.05}).values
    free = model.parameters.with_values({
        n: 0.0 for n in model.parameters.names if n.rstrip("123456") in ("Fv", "Fc")
    }).values  # fmt: skip
    runs = []
    for rows in twin.blocks(files("identification")):
        own, more, less = (
            model.simulate(np.zeros(0), rows.u, rows.dt, q)[1] for q in (p, loaded, free)
        )
        runs.append(Run(rows, own - less, more - own))
    return Arm(twin, runs, folder)


class Path6(NamedTuple):
    """The friction that the twin found in each run of a series, and the truth."""

    friction: np.ndarray
    """(runs, 6), over its value when new."""
    since: np.ndarray
    """Time in use at the start of each run [s]."""
    joint: int
    life: float
    payload: float
    """Error of the payload's mass, mean over the runs [kg]."""


def path(arm: Arm, new: np.ndarray, seed: int) -> Path6:
    """A series of runs of one arm in which one joint wears."""
    rng = np.random.default_rng([3, seed])
    joint, life, k = int(rng.integers(6)), float(rng.uniform(45, 90)), np.arange(1, RUNS + 1)
    law = k / life if rng.random() < 0.5 else np.expm1(2 * k / life) / np.expm1(2)
    a, tau = rng.uniform(0.1, 0.3, 6), rng.uniform(1200.0, 2400.0)
    cold = rng.random(RUNS) < np.where(k > RUNS / 2, 0.7, 0.3)
    since = np.where(cold, rng.uniform(0, 900, RUNS), rng.uniform(3600, 10_800, RUNS))
    mass = rng.uniform(0.0, 4.0) * (k >= rng.integers(10, 50))
    found, off = np.empty((RUNS, 6)), []
    for i in range(RUNS):
        run = arm.runs[int(rng.integers(len(arm.runs)))]
        worn = np.where(np.arange(6) == joint, (LIMIT - 1.0) * law[i], 0.0)
        t = (run.rows.t - run.rows.t[0])[:, None] * 1e-9
        heat = a * np.exp(-(since[i] + t) / tau)
        added = run.friction * ((1.0 + worn) * (1.0 + heat) - 1.0) + mass[i] * run.load
        found[i], held = arm.tuned(run, added)
        off.append(abs(held - mass[i]))
    return Path6(found / new, since, joint, life, float(np.mean(off)))


def asked(told: Told, one: Path6, joint: int, stop: int) -> ComponentLife:
    """What the twin says of a joint after some runs."""
    history = {"run": np.arange(1.0, RUNS + 1.0), "wear": one.friction[:, joint],
               "since_start": one.since}  # fmt: skip
    return told.component(until(history, float(stop), "run"))


def covered(told: Told, worn: list[Path6], cut: float) -> tuple[int, int, int]:
    """Prints how often the true life lies inside at a cut; (inside 80 %, inside 95 %, told)."""
    mean = float(np.mean([one.life for one in worn]))
    due = [one for one in worn if 6 <= int(cut * one.life) <= RUNS]
    inside, lives, errors, dummy = [0, 0], 0, [], []
    for one in due:
        stop = int(cut * one.life)
        life, left = asked(told, one, one.joint, stop).life, one.life - stop
        if not isinstance(life, Life):
            continue
        lives += 1
        for k, (low, high) in enumerate((life.interval80, life.interval95)):
            inside[k] += low <= left <= high
        errors.append(abs(life.median - left))
        dummy.append(abs(max(mean - stop, 0.0) - left))
    middle = [float(np.median(x)) if x else np.nan for x in (errors, dummy)]
    print(
        f"  life at {100 * cut:.0f} %: answered {lives} of {len(due)}, true inside 80 % in "
        f"{inside[0]}, inside 95 % in {inside[1]}; median |error| {middle[0]:.1f} runs, dummy "
        f"{middle[1]:.1f}"
    )
    return inside[0], inside[1], lives


def main() -> int:
    """Prints the counts; exit code 1 if a demand is missed."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    paths, demands = int(sys.argv[1]) if len(sys.argv) > 1 else 20, dict[str, bool]()
    with (
        tempfile.TemporaryDirectory() as folder,
        Told(clock="run", limit=LIMIT, warm_up=WARM) as told,
    ):
        arm = prepared(Path(folder))
        plain: Any = [arm.tuned(run, np.zeros_like(run.friction))[0] for run in arm.runs]
        new, scatter = np.mean(plain, axis=0), np.std(plain, axis=0, ddof=1)
        print("scatter of friction between runs, %: "
              + " ".join(f"{100 * s:.1f}" for s in scatter / new))  # fmt: skip
        worn = [path(arm, new, seed) for seed in range(paths)]
        calm = [asked(told, p, j, RUNS).life for p in worn for j in range(6) if j != p.joint]
        grown = sum(isinstance(life, Life) or life.onset is not None for life in calm)
        print(f"{len(calm)} joints with warm-up and load but no wear: growth told in {grown}; the "
              "dummy takes all for worn")  # fmt: skip
        payload = np.mean([one.payload for one in worn])
        print(f"payload tuned beside friction: {payload:.3f} kg off in the mean of the paths")
        in80, in95, lives = np.sum([covered(told, worn, cut) for cut in CUTS], axis=0).tolist()
        print(f"all cuts: true inside 80 % in {in80} ({in80 / lives:.0%}), inside 95 % in {in95} "
              f"({in95 / lives:.0%}) of {lives}")  # fmt: skip
        for level, inside in ((0.80, in80), (0.95, in95)):
            demands[f"intervals of {level:.0%}"] = holds(level, inside / lives)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
