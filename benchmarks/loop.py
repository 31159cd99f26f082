"""The whole loop's speed: `python -m benchmarks.loop [--rows 1000000]`.

A row is a row of the union clock. The robot (plane pose from speed and turn rate) has 50 rows a
second, the pose in every fifth; its drive has a dead zone and a cap that the naive champion does
not know, so position updates come at the naive model's rate. The arm has 1,000 rows a second with
18 inputs and 6 torques. Beside the champion a challenger runs on trial, undecided (the twin is
pinned): track, predictions over the horizon of both, books, detectors, gate, ring of the newest
rows, and decisions at every beat (every 10 s for the robot, every second for the arm).

Blocks are rows in memory; reading files is `benchmarks.stream`. A block of one is a whole
`Driver.step`, beats included. Times are wall-clock: the best of the repeats for blocks, the median
for blocks of one.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from evertwin.config.spec import (
    ArbiterSpec,
    ModelSpec,
    MovingSpec,
    ParameterSpec,
    PredictionSpec,
    Span,
    TrialSpec,
    TuningSpec,
    TwinSpec,
)
from evertwin.fold import Block, copy, make_block, take
from evertwin.loop.configured_model import model_of
from evertwin.loop.driver import Driver
from evertwin.loop.setup import Setup
from evertwin.loop.twin_state import TRIAL, TwinState
from evertwin.loop.versions import Versions
from evertwin.models.form import Form

SEED = 0
NEVER = 10**12


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def robot(rows: int) -> tuple[TwinSpec, Block, str, float]:
    """The robot's settings and rows, what the challenger changes, and the least rows per second."""
    rng = np.random.default_rng(SEED)
    seconds = rows // 50 + 1
    v = np.repeat(0.01 * rng.integers(0, 21, seconds), 50)[:rows]
    w = np.repeat(rng.uniform(-0.3, 0.3, seconds), 50)[:rows]
    drive = np.where(v < 0.06, 0.0, np.minimum(v, 0.16))
    heading = np.cumsum(w) * 0.02
    middle = heading - 0.01 * w
    x, y = np.cumsum(drive * np.cos(middle)) * 0.02, np.cumsum(drive * np.sin(middle)) * 0.02
    pose = np.stack([x, y, np.angle(np.exp(1j * heading))], axis=1)
    pose += rng.normal(0.0, [0.002, 0.002, 0.002], pose.shape)
    pose[np.arange(rows) % 5 != 0] = np.nan
    spec = TwinSpec(
        "robot", ModelSpec("differential"), beat=Span(500),
        arbiter=ArbiterSpec(use="tolerance", tolerance=0.02, tolerance_angle=0.02),
        prediction=PredictionSpec(horizon=1.0), trial=TrialSpec(limit=NEVER),
        tuning=TuningSpec(window=Span(20_000)),
    )  # fmt: skip
    block = make_block(t=np.arange(rows) * 20_000_000, u=np.stack([v, w], axis=1), y=pose)
    return spec, block, "gain", 1e6


def arm(rows: int) -> tuple[TwinSpec, Block, str, float]:
    """The arm's settings and rows, what the challenger changes, and the least rows per second."""
    rng = np.random.default_rng(SEED)
    t = 1e-3 * np.arange(rows)[:, None]
    w, a = rng.uniform(0.2, 0.7, 6), rng.uniform(0.3, 0.9, 6)
    u = np.concatenate(
        [a * np.sin(w * t), a * w * np.cos(w * t), -a * w**2 * np.sin(w * t)], axis=1
    )
    names = tuple(f"Fc{k}" for k in range(1, 7))
    spec = TwinSpec(
        "arm", ModelSpec("arm", {"urdf": "ur5_like", "law": "tanh"},
                         {name: ParameterSpec(value=5.0) for name in names}), beat=Span(1000),
        arbiter=ArbiterSpec(gate=12.0), prediction=PredictionSpec(horizon=1.0),
        moving=MovingSpec(channels={f"tau{k}": f"qd{k}" for k in range(1, 7)}, above=0.05),
        trial=TrialSpec(limit=NEVER), tuning=TuningSpec(window=Span(20_000)),
    )  # fmt: skip
    model = model_of(spec, None)
    _, tau = model.simulate(np.zeros(0), u, np.zeros(rows), model.parameters.values)
    tau += rng.normal(0.0, 0.5, tau.shape)
    return spec, make_block(t=np.arange(rows) * 10**6, u=u, y=tau), "Fc1", 3e5


def started(spec: TwinSpec, changed: str) -> tuple[Driver, TwinState]:
    """A twin with a challenger on trial that stays undecided."""
    setup = Setup(spec, model_of(spec, None))
    versions = Versions(setup.model)
    value = 1.02 * dict(versions.values(0))[changed]
    versions.add(Form(), {changed: value}, parent=0, reason="challenger")
    driver = Driver(setup, versions, lambda row, said: None, pinned=True)
    state = driver.init()
    desk = state.agenda._replace(phase=TRIAL)
    return driver, state._replace(other=driver.follow.lane(1, tracked=False), agenda=desk)


def in_blocks(spec: TwinSpec, rows: Block, changed: str, size: int, repeats: int) -> float:
    """Rows per second in blocks of ``size`` rows."""
    n, best = len(rows.t), np.inf
    for _ in range(repeats):
        driver, state = started(spec, changed)
        state = driver.step(state, take(rows, 0, size))
        begin = time.perf_counter()
        for start in range(size, n, size):
            state = driver.step(state, take(rows, start, min(start + size, n)))
        best = min(best, time.perf_counter() - begin)
    return (n - size) / best


def in_ones(spec: TwinSpec, rows: Block, changed: str, count: int) -> np.ndarray:
    """Seconds of each step of one row, after the detectors have calibrated."""
    driver, state = started(spec, changed)
    warm = len(rows.t) - count
    state = driver.step(state, take(rows, 0, warm))
    spent = np.empty(count)
    for i in range(count):
        one = take(rows, warm + i, warm + i + 1)
        begin = time.perf_counter()
        state = driver.step(state, one)
        spent[i] = time.perf_counter() - begin
    return spent


def measure(name: str, rows: int, repeats: int) -> None:
    """Prints one machine's figures."""
    spec, block, changed, least = (robot if name == "robot" else arm)(rows)
    driver, state = started(spec, changed)
    state = driver.step(copy(state), block)
    updates = int(state.live.track.updates.sum())
    say(f"-- {name}: {rows} rows, a beat every {spec.beat}; {updates} position updates, "
        f"detectors calibrated: {bool(state.detect.cusum.calibration.ready)}")  # fmt: skip
    for size in (min(262_144, rows // 2), 65_536, 4_096):
        rate = in_blocks(spec, block, changed, size, repeats)
        aim = f"   {rate / least:5.2f} x the aim" if size >= 65_536 else ""
        say(f"blocks of {size:7d} rows   {rate / 1e6:8.3f} M rows/s{aim}")
    spent = in_ones(spec, take(block, 0, min(rows, 50_000)), changed, 10_000)
    p50, p99 = 1e6 * np.quantile(spent, [0.5, 0.99])
    say(f"a block of one           {p50:8.1f} us median, {p99:.1f} us at 99 %   "
        f"{50.0 / p50:5.2f} x the aim")  # fmt: skip


def main() -> None:
    """Both machines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=3)
    chosen = parser.parse_args()
    for name in ("robot", "arm"):
        measure(name, chosen.rows, chosen.repeats)


if __name__ == "__main__":
    main()
