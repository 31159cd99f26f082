"""The real arm: `python -m proofs.ur10e` (needs EVERTWIN_DATA).

Deviation is rms(measured − predicted) / rms(measured) per joint, torques filtered at 5 Hz; "all":
all rows of the crop, "moving": rows on which the joint is faster than 0.05 rad/s.

1. The sign law, trained on the 30 s run of 10 February and the 50 s run of 12 February.
2. The law that the ladder chooses on the runs before 19 February, on the run of 19 February.
3. Every day left out in turn; friction re-tuned in the stream, predict 1 s, then learn.
4. The same motion without and with a load: what explains the deviation, and the load's mass.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evertwin.config import TwinSpec, read
from evertwin.fold import Block
from evertwin.loop.configured_model import model_of
from evertwin.loop.feed import Feed
from evertwin.machines.arm import Arm
from evertwin.models import Parameters
from evertwin.signals.filters import Butterworth
from evertwin.tuning import Fit, Problem, Recursive, solve
from evertwin.tuning.terms import Ascent, climb_terms

SMOOTH = Butterworth(cutoff=5.0, rate=100.0)
LAST = "ur-20_02_19_14harm50sec"
PAIR = ("ur-20_02_10-30sec_12harm", "ur-20_02_12-50sec_12harm")
REFERENCE = {
    LAST: (10.5, 4.5, 4.3, 11.3, 17.1, 12.7),
    "ur-20_02_12-40sec_12harm": (10.1, 4.2, 4.8, 8.7, 12.8, 12.8),
}
FRICTION = ("Fv", "Fc", "offset", "Fs", "Fr", "Fl")
PAYLOAD = ("payload.m", "payload.mx", "payload.my", "payload.mz")


def data() -> Path:
    """Folder of the recordings."""
    return Path(os.environ["EVERTWIN_DATA"]) / "ur10e"


def runs(spec: TwinSpec, arm: Arm, folder: str) -> dict[str, Block]:
    """Every recording of a folder as rows."""
    feed = Feed(spec, arm)
    paths = sorted((data() / folder).glob("*.csv"))
    return {path.stem: next(iter(feed.blocks([path]))) for path in paths}


def day(run: str) -> str:
    """Month and day of a run, from its name."""
    return run[6:11]


def editable(arm: Arm) -> tuple[str, ...]:
    """Drives and base inertial parameters, without the payload."""
    return tuple(n for n in arm.parameters.editable if not n.startswith("payload"))


def friction(arm: Arm) -> tuple[str, ...]:
    """Names of all friction coefficients."""
    return tuple(n for n in arm.parameters.names if n.rstrip("123456") in FRICTION)


def problem(arm: Arm, blocks: Sequence[Block], names: tuple[str, ...] = ()) -> Problem:
    """The tuning problem on moving rows, filtered."""
    return Problem(
        arm, tuple(blocks), names or editable(arm), filter=SMOOTH, moving=arm.moving(0.05),
        only_moving=True,
    )  # fmt: skip


def deviation(y: np.ndarray, predicted: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, ...]:
    """(all rows, moving rows, number of moving rows) per joint, in percent."""
    n = y.shape[1]
    y, r = SMOOTH(y), SMOOTH(y - predicted)
    moving = np.abs(u[:, n : 2 * n]) > 0.05
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.sqrt((r**2 * moving).sum(axis=0) / (y**2 * moving).sum(axis=0))
    return 100 * np.sqrt((r**2).mean(axis=0) / (y**2).mean(axis=0)), 100 * part, moving.sum(axis=0)


def score(arm: Arm, p: np.ndarray, block: Block) -> tuple[np.ndarray, ...]:
    """Deviations of a fixed model on one run."""
    return deviation(block.y, arm.simulate(np.zeros(0), block.u, block.dt, p)[1], block.u)


def show(values: np.ndarray) -> str:
    """One figure per joint."""
    return " ".join(f"{v:5.1f}" if np.isfinite(v) else "    –" for v in values)


def sign_law(arm: Arm, known: Mapping[str, Block]) -> None:
    """Part 1."""
    print("1. sign law, trained on the 30 s run of 10 Feb and the 50 s run of 12 Feb")
    fit = solve(problem(arm.with_laws("sign"), [known[n] for n in PAIR]))
    for name, block in known.items():
        if name in PAIR:
            continue
        every, moving, _ = score(arm.with_laws("sign"), fit.p, block)
        print(f"   {name:26} all {show(every)} | moving {show(moving)}")
        if name in REFERENCE:
            print(f"   {'reference':26} all {show(np.array(REFERENCE[name]))}")


def climbed(arm: Arm, train: Sequence[Block], order: Sequence[str]) -> tuple[Arm, Ascent]:
    """The arm with the law that pays on each run held out in turn."""
    terms = [rung for term in order for rung in arm.rungs() if rung.name == term]
    ascent = climb_terms(problem(arm, train), terms)
    return arm.with_laws([arm.law_name(k, taken) for k, taken in enumerate(ascent.taken)]), ascent


def chosen_law(arm: Arm, known: Mapping[str, Block], order: Sequence[str]) -> Arm:
    """Part 2."""
    print("2. law chosen on the runs before 19 Feb (each run held out in turn)")
    train = [block for name, block in known.items() if name != LAST]
    best, ascent = climbed(arm, train, order)
    for step in ascent.steps:
        mark = "taken" if step.taken else "not"
        print(f"   {step.output} {step.term:9} {step.before:6.3f} -> {step.after:6.3f} Nm  {mark}")
    print("   chosen: " + ", ".join(map(str, best.laws)))
    fit = solve(problem(best, train))
    every, moving, _ = score(best, fit.p, known[LAST])
    print(f"   {LAST:26} all {show(every)} | moving {show(moving)}")
    return best


def prior(arm: Arm, fit: Fit) -> Parameters:
    """The fit as start, and how far friction may have moved since: 10 % and a bit of Coulomb."""
    items = []
    for item in arm.parameters.with_values(fit.p):
        if item.name in friction(arm):
            coulomb = abs(fit.p[arm.parameters.index(f"Fc{item.name[-1]}")])
            item = replace(item, sigma=0.1 * abs(item.value) + 0.02 * coulomb)
        items.append(item)
    return Parameters(tuple(items))


def in_the_stream(arm: Arm, start: Parameters, scale: np.ndarray, block: Block) -> np.ndarray:
    """Predictions, each second's friction learned from the seconds before."""
    n = arm.chain.n
    stage = Recursive(
        arm, friction(arm), tuple(scale.tolist()), memory=20.0, every=100, prior=start,
        moving=tuple((j, n + j, 0.05) for j in range(n)),
    )  # fmt: skip
    _, out = stage.step(stage.init(), block)
    return np.asarray(out.rows.y)


def leave_one_day_out(
    rich: Arm, known: Mapping[str, Block], others: Mapping[str, Block], order: Sequence[str]
) -> None:
    """Part 3. The law is chosen anew without the day that is left out."""
    print("3. leave one day out, moving rows: fixed model | friction re-tuned every second")
    print("   (joints with at least 300 moving rows)")
    everything = dict(others) | dict(known)
    worst = np.zeros(rich.chain.n)
    for today in sorted({day(name) for name in everything}):
        train = [block for name, block in known.items() if day(name) != today]
        arm, _ = climbed(rich, train, order)
        fit = solve(problem(arm, train))
        start = prior(arm, fit)
        left = [b.y - arm.simulate(np.zeros(0), b.u, b.dt, fit.p)[1] for b in train]
        scale = 3.0 * np.concatenate(left).std(axis=0)
        for name in (n for n in everything if day(n) == today):
            block = everything[name]
            _, fixed, count = score(arm, fit.p, block)
            _, tuned, _ = deviation(block.y, in_the_stream(arm, start, scale, block), block.u)
            fixed, tuned = (np.where(count >= 300, v, np.nan) for v in (fixed, tuned))
            worst = np.fmax(worst, tuned)
            print(f"   {name:26} {show(fixed)} | {show(tuned)}")
    print(f"   {'worst':26} {'':35} | {show(worst)}")


def load_pair(arm: Arm, known: Mapping[str, Block], pair: Mapping[str, Block]) -> None:
    """Part 4."""
    print("4. load_pair: share of the squared deviation that each refit explains")
    trained = solve(problem(arm, list(known.values())))
    start = replace(arm, parameters=arm.parameters.with_values(trained.p))
    noise = trained.noise
    for name, block in pair.items():
        shares = {}
        for cause, names in (("friction", friction(start)), ("load", PAYLOAD)):
            fit = solve(problem(start, [block], names))
            before = np.array([r.rms_before for r in fit.residuals]) / noise
            after = np.array([r.rms_after for r in fit.residuals]) / noise
            shares[cause] = 1 - (after**2).sum() / (before**2).sum()
            if cause == "load":
                low, high = fit.interval95[0]
                mass = f"{fit.values[0]:.2f} kg [{low:.2f}, {high:.2f}]"
        size = np.sqrt((before**2).mean())
        print(
            f"   {name:26} deviation {size:5.1f} x the training residual | friction "
            f"{shares['friction']:.2f}, load {shares['load']:.2f} | mass {mass}"
        )


def main() -> int:
    """Prints all four parts."""
    if "EVERTWIN_DATA" not in os.environ:
        print("EVERTWIN_DATA is not set: expected the folder of real recordings")
        return 4
    spec = read(Path(__file__).parent.parent / "twins" / "ur10e.toml")
    arm = model_of(spec)
    assert isinstance(arm, Arm)
    known = runs(spec, arm, "identification")
    pair = runs(spec, arm, "load_pair")
    sign_law(arm, known)
    best = chosen_law(arm, known, spec.tuning.ladder)
    others = runs(spec, arm, "jointwise") | {k: v for k, v in pair.items() if "unload" in k}
    leave_one_day_out(arm, known, others, spec.tuning.ladder)
    load_pair(best, known, pair)
    return 0


if __name__ == "__main__":
    sys.exit(main())
