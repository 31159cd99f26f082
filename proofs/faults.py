"""What a twin makes of faults of a sensor, one by one: `python -m proofs.faults [SEEDS]`.

`Twin.run` on `twins/robot1d.toml`, its gain 5 % off (`planted/robots.py`), 120 s each;
`proofs.arbiter` counts the same and more kinds over several ways to drive.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np

from evertwin import RunResult
from planted.robots import RATE, SIGMA, Run, drive, followed

ROWS, ONSET = 1200, 600


def clean(seed: int, *, rest: bool = False) -> Run:
    """A recording without fault; with ``rest`` the robot stands still from the onset on."""
    run = drive(seed, ROWS)
    if not rest:
        return run
    v, truth = run.v.copy(), run.truth.copy()
    v[ONSET:], truth[ONSET:] = 0.0, truth[ONSET - 1]
    return Run(v, truth + run.y - run.truth, truth, run.faulty)


def off(result: RunResult, truth: np.ndarray) -> float:
    """Mean square of the predicted position's error."""
    return float(np.nanmean((result.trace["predicted"][:, 0] - truth) ** 2))


def causes(result: RunResult) -> list[object]:
    """What the events name as the cause of errors."""
    return [event.evidence.get("cause") for event in result.events]


def frozen(seeds: int) -> Iterator[str]:
    """Values held, in motion and at rest."""
    for seconds in (1, 3, 10, 60):
        found, delays, false = 0, [], 0
        for seed in range(seeds):
            for rest in (False, True):
                run = clean(seed, rest=rest)
                run.y[ONSET : ONSET + int(seconds * RATE)] = run.y[ONSET]
                result = followed(run)
                told = "frozen" in causes(result)
                if rest:
                    false += told
                elif told:
                    found += 1
                    delays.append(float(np.argmax(result.trace["mark"][ONSET:, 0] == 6)) / RATE)
        delay = f"after {np.median(delays):.1f} s" if delays else ""
        yield f"frozen {seconds:3d} s: in motion {found / seeds:.0%} {delay}, at rest {false}"


def spikes(seeds: int) -> Iterator[str]:
    """One to three samples off."""
    for size in (5, 8, 10, 20, 100):
        refused, ratio = [], []
        for seed in range(seeds):
            run, rng = clean(seed), np.random.default_rng(seed)
            base, hit = off(followed(run), run.truth), run.faulty.copy()
            for start in np.arange(50, 1150, 100):
                at = slice(start, start + int(rng.integers(1, 4)))
                hit[at] = True
                run.y[at] += rng.choice([-1, 1]) * size * SIGMA
            result = followed(run)
            refused.append((result.trace["mark"][hit, 0] > 2).mean())
            ratio.append(off(result, run.truth) / base)
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
            run = clean(seed)
            y = float(run.y[stop])
            run.y[ONSET:stop] = np.nan
            trace = followed(run).trace
            errors.append(trace["predicted"][stop, 0] - run.truth[stop])
            inside.append(abs(y - trace["predicted"][stop, 0]) < 1.96 * trace["sigma"][stop - 1, 0])
        yield (
            f"dropout {seconds:4g} s: RMSE at its end {np.sqrt(np.mean(np.square(errors))):.3f} m, "
            f"{np.mean(inside):.0%} inside the 95 % band"
        )


def jumps(seeds: int) -> Iterator[str]:
    """The machine itself is moved."""
    for size in (5, 10, 30, 100, 1000):
        times, resets = [], 0
        for seed in range(seeds):
            run = clean(seed)
            run.y[ONSET:] += size * SIGMA
            run.truth[ONSET:] += size * SIGMA
            result = followed(run)
            bad = np.abs(result.trace["predicted"][ONSET:, 0] - run.truth[ONSET:]) > 0.05
            times.append(float((np.flatnonzero(bad)[-1] + 1) / RATE) if bad.any() else 0.0)
            resets += len(result.of_kind("overruled"))
        yield (
            f"real jump of {size:4d} σ: error under 5 cm after {np.median(times):.1f} s (at most "
            f"{max(times):.1f} s), overruled in {resets / seeds:.0%}, else followed by the blend"
        )


def noise(seeds: int) -> Iterator[str]:
    """The sensor's noise changes half-way."""
    for factor in (0.1, 0.3, 3.0, 10.0):
        inside, refused = [], []
        for seed in range(seeds):
            run = drive(seed, 2 * ROWS)
            run.y[ROWS:] += (factor - 1.0) * (run.y - run.truth)[ROWS:]
            trace, late = followed(run).trace, slice(ROWS + 300, None)
            z = trace["residual"][late, 0] / trace["sigma"][late, 0]
            inside.append(np.mean(np.abs(z[np.isfinite(z)]) < 1.96))
            refused.append((trace["mark"][late, 0] > 2).mean())
        yield (
            f"noise × {factor:4g}: {np.mean(inside):.0%} inside the 95 % band 30 s later, "
            f"{np.mean(refused):.1%} refused"
        )


def factors(seeds: int) -> Iterator[str]:
    """A wrong unit from some row on."""
    for name, factor in (("mm", 1000.0), ("cm", 100.0), ("inch", 1 / 0.0254), ("km", 1e-3)):
        named, samples = 0, []
        for seed in range(seeds):
            run = clean(seed)
            run.y[ONSET:] *= factor
            result = followed(run)
            told = [e.evidence for e in result.events if e.evidence.get("cause") == "factor"]
            named += any(abs(float(one["factor"]) / factor - 1) < 0.02 for one in told)  # type: ignore[arg-type]
            samples.append(int(np.argmax(result.trace["mark"][ONSET:, 0] > 2)))
        yield (
            f"unit {name:4}: refused after {np.median(samples):.0f} samples, factor named in "
            f"{named / seeds:.0%}"
        )


def main() -> int:
    """Prints one line per fault."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    parts: tuple[Callable[[int], Iterator[str]], ...] = (
        frozen, spikes, dropouts, jumps, noise, factors,
    )  # fmt: skip
    print(f"{seeds} seeds")
    for part in parts:
        for line in part(seeds):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
