"""What a twin makes of faults of a sensor, one by one: `python -m proofs.faults [SEEDS]`.

The one-axis robot of `proofs.arbiter` (10 Hz, σ 1 cm, gain 5 % off, blend), 120 s each.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np

from evertwin.fold import Block, Event, fold
from evertwin.machines.mobile import Robot1D
from evertwin.signals import Layout
from evertwin.sync import Arbiter, Rule, Track, TrackRows
from evertwin.sync.lag import shared_lag
from proofs.arbiter import RATE, SIGMA, followed, recording, recovery

ROWS, ONSET = 1200, 600
STAGE = Track(Robot1D(), Arbiter(Rule(use="blend", sigma=SIGMA)))


def clean(seed: int, *, rest: bool = False) -> tuple[Block, np.ndarray]:
    """A recording without fault; with ``rest`` the robot stands still from the onset on."""
    run = recording("clean", seed, ROWS)
    if not rest:
        return run.block, run.truth
    noise = run.block.y[:, 0] - run.truth
    run.block.u[ONSET:] = 0.0
    truth = np.concatenate([run.truth[:ONSET], np.full(ROWS - ONSET, run.truth[ONSET - 1])])
    return run.block._replace(y=(truth + noise)[:, None]), truth


def judged(block: Block) -> tuple[TrackRows, tuple[Event, ...]]:
    """The rows of the twin and its records."""
    _, out = fold(STAGE, [block], STAGE.renew(STAGE.init(), np.array([1.05])))
    return out.rows, out.records


def frozen(seeds: int) -> Iterator[str]:
    """Values held, in motion and at rest."""
    for seconds in (1, 3, 10, 60):
        found, delays, false = 0, [], 0
        for seed in range(seeds):
            for rest in (False, True):
                block, _ = clean(seed, rest=rest)
                block.y[ONSET : ONSET + int(seconds * RATE)] = block.y[ONSET]
                _, records = judged(block)
                told = [e for e in records if e.evidence.get("cause") == "frozen"]
                if rest:
                    false += bool(told)
                elif told:
                    found += 1
                    marks = judged(block)[0].mark[ONSET:, 0]
                    delays.append(float(np.argmax(marks == 6)) / RATE)
        delay = f"after {np.median(delays):.1f} s" if delays else ""
        yield f"frozen {seconds:3d} s: in motion {found / seeds:.0%} {delay}, at rest {false}"


def spikes(seeds: int) -> Iterator[str]:
    """One to three samples off."""
    for size in (5, 8, 10, 20, 100):
        refused, ratio = [], []
        for seed in range(seeds):
            block, truth = clean(seed)
            base = np.mean((followed(STAGE, block, 1.05)[0] - truth) ** 2)
            rng = np.random.default_rng(seed)
            hit = np.zeros(ROWS, dtype=np.bool_)
            for start in np.arange(50, 1150, 100):
                at = slice(start, start + int(rng.integers(1, 4)))
                hit[at] = True
                block.y[at] += rng.choice([-1, 1]) * size * SIGMA
            refused.append((judged(block)[0].mark[hit, 0] > 2).mean())
            ratio.append(np.mean((followed(STAGE, block, 1.05)[0] - truth) ** 2) / base)
        yield (
            f"spikes of {size:3d} σ, 11 of 1 to 3 samples: {np.mean(refused):.0%} refused, RMSE "
            f"{np.sqrt(np.mean(ratio)):.2f} × clean"
        )


def dropouts(seeds: int) -> Iterator[str]:
    """Nothing measured for a while."""
    for seconds in (0.5, 2, 10, 30):
        inside, errors = [], []
        stop = ONSET + int(seconds * RATE)
        for seed in range(seeds):
            block, truth = clean(seed)
            y = block.y[stop].copy()
            block.y[ONSET:stop] = np.nan
            rows, _ = judged(block)
            errors.append(rows.y[stop, 0] - truth[stop])
            inside.append(abs(y[0] - rows.y[stop, 0]) < 1.96 * rows.sigma[stop - 1, 0])
        yield (
            f"dropout {seconds:4g} s: RMSE at its end {np.sqrt(np.mean(np.square(errors))):.3f} m, "
            f"{np.mean(inside):.0%} inside the 95 % band"
        )


def jumps(seeds: int) -> Iterator[str]:
    """The machine itself is moved."""
    for size in (5, 10, 30, 100, 1000):
        times, resets = [], 0
        for seed in range(seeds):
            block, truth = clean(seed)
            block.y[ONSET:] += size * SIGMA
            truth[ONSET:] += size * SIGMA
            x, records = followed(STAGE, block, 1.05)
            times.append(recovery(x, truth))
            resets += sum(e.kind == "overruled" for e in records)
        yield (
            f"real jump of {size:4d} σ: error under 5 cm after {np.median(times):.1f} s (at most "
            f"{max(times):.1f} s), overruled in {resets / seeds:.0%}, else followed by the blend"
        )


def noise(seeds: int) -> Iterator[str]:
    """The sensor's noise changes half-way."""
    for factor in (0.1, 0.3, 3.0, 10.0):
        inside, refused = [], []
        for seed in range(seeds):
            run = recording("clean", seed, 2 * ROWS)
            off = run.block.y[:, 0] - run.truth
            off[ROWS:] *= factor
            rows, _ = judged(run.block._replace(y=(run.truth + off)[:, None]))
            late = slice(ROWS + 300, None)
            z = rows.residual[late, 0] / rows.sigma[late, 0]
            inside.append(np.mean(np.abs(z[np.isfinite(z)]) < 1.96))
            refused.append((rows.mark[late, 0] > 2).mean())
        yield (
            f"noise × {factor:4g}: {np.mean(inside):.0%} inside the 95 % band 30 s later, "
            f"{np.mean(refused):.1%} refused"
        )


def factors(seeds: int) -> Iterator[str]:
    """A wrong unit from some row on."""
    for name, factor in (("mm", 1000.0), ("cm", 100.0), ("inch", 1 / 0.0254), ("km", 1e-3)):
        named, samples = 0, []
        for seed in range(seeds):
            block, _ = clean(seed)
            block.y[ONSET:] *= factor
            rows, records = judged(block)
            told = [e for e in records if e.evidence.get("cause") == "factor"]
            near = any(abs(e.evidence["factor"] / factor - 1) < 0.02 for e in told)  # type: ignore[operator]
            named += near
            samples.append(int(np.argmax(rows.mark[ONSET:, 0] > 2)))
        yield (
            f"unit {name:4}: refused after {np.median(samples):.0f} samples, factor named in "
            f"{named / seeds:.0%}"
        )


def lags(seeds: int) -> Iterator[str]:
    """The measurement comes late."""
    for planted in (-0.5, -0.1, 0.1, 0.5):
        errors = []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            t = np.arange(0, 120, 0.1)
            path = [np.sin(0.9 * (t - d)) + 0.3 * np.sin(2.1 * (t - d) + 1) for d in (0, planted)]
            block, _ = clean(seed)
            y = (path[1] + rng.normal(0, SIGMA, len(t)))[:, None]
            found = shared_lag(block._replace(y=y), path[0][:, None], Layout.of(x="m"), 0.8)
            errors.append(abs(found.seconds - planted) * 1e3)
        middle, most = np.median(errors), max(errors)
        yield f"lag {planted:+.1f} s: found within {middle:.1f} ms (median), {most:.1f} ms at most"


def main() -> int:
    """Prints one line per fault."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    parts: tuple[Callable[[int], Iterator[str]], ...] = (
        frozen, spikes, dropouts, jumps, noise, factors, lags,
    )  # fmt: skip
    print(f"{seeds} seeds")
    for part in parts:
        for line in part(seeds):
            print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
