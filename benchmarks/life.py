"""Simulated and predicted lives beside ProgPy: `python -m benchmarks.life [--samples 1000]`.

One law for both: crack-like growth, rate = c·x^1.3 per hour with process noise σ, from x = 0.2 to
the limit 1; the same Euler step, the same number of samples, the same noise. ProgPy simulates
sample after sample, `simulate_lives` all at once. Both must give the same life: medians and
80 % intervals are compared. `predict_life` is the closed form over all laws, from 50 values.

Times are medians of repeats in processor time; ProgPy runs once.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np
from evertwin.prognosis.laws.simulate import Steps, simulate_lives

from evertwin.prognosis.laws import Indicator, Limit, predict_life

START, LIMIT, C, POWER, NOISE = 0.2, 1.0, 0.01, 1.3, 0.004
STEP, HORIZON = 1.0, 2000.0


def timed(work: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """(result, median time [s])."""
    times, result = [], None
    for _ in range(repeats):
        start = time.process_time()
        result = work()
        times.append(time.process_time() - start)
    return result, float(np.median(times))


def ours(samples: int) -> np.ndarray:
    """All samples at once."""
    return simulate_lives(
        lambda x, t: C * np.maximum(x, 0.0) ** POWER, np.full(samples, START), LIMIT,
        Steps(STEP, HORIZON, NOISE), np.random.default_rng(0),
    )  # fmt: skip


def progpy(samples: int) -> np.ndarray:
    """The same law in ProgPy's Monte Carlo predictor."""
    from progpy import PrognosticsModel
    from progpy.predictors import MonteCarlo
    from progpy.uncertain_data import ScalarData

    class Growth(PrognosticsModel):  # type: ignore[misc]
        """rate = C·x^POWER."""

        inputs: ClassVar[list[str]] = []
        states: ClassVar[list[str]] = ["x"]
        outputs: ClassVar[list[str]] = ["x"]
        events: ClassVar[list[str]] = ["worn"]
        default_parameters: ClassVar[dict[str, Any]] = {"x0": {"x": START}}

        def dx(self, x: Any, u: Any) -> Any:
            return self.StateContainer({"x": C * np.maximum(x["x"], 0.0) ** POWER})

        def output(self, x: Any) -> Any:
            return self.OutputContainer({"x": x["x"]})

        def event_state(self, x: Any) -> dict[str, Any]:
            return {"worn": (LIMIT - x["x"]) / (LIMIT - START)}

        def threshold_met(self, x: Any) -> dict[str, Any]:
            return {"worn": x["x"] >= LIMIT}

    # Its noise is added per step as noise·dt: σ·√Δt over a step is σ/√Δt there.
    model = Growth(process_noise={"x": NOISE / np.sqrt(STEP)})
    start = ScalarData({"x": START}, _type=model.StateContainer)
    found = MonteCarlo(model).predict(
        start, lambda t, x=None: model.InputContainer({}), n_samples=samples, dt=STEP,
        horizon=HORIZON, save_freq=HORIZON,
    )  # fmt: skip
    ends = found.time_of_event.key("worn")
    return np.array([np.inf if end is None else end for end in ends], dtype=np.float64)


def line(name: str, seconds: float, lives: np.ndarray) -> None:
    """One line of figures."""
    low, half, high = np.quantile(lives, [0.1, 0.5, 0.9])
    print(
        f"{name:34s} {1e3 * seconds:10.1f} ms   median {half:6.1f} h, 80 % {low:.1f} to {high:.1f}"
    )
    sys.stdout.flush()


def closed_form() -> float:
    """Time of one `predict_life` [s]."""
    rng = np.random.default_rng(1)
    t = np.arange(50.0)
    value = 0.2 + 0.008 * t + 0.01 * rng.standard_normal(50)
    wear = Indicator.of("wear", "mm", Limit(1.0), t, value)
    predict_life(wear)
    return timed(lambda: predict_life(wear), 20)[1]


def main() -> int:
    """Prints the figures; exit code 1 if ours is not 10 times as fast or takes over 0.2 s."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1000)
    samples = parser.parse_args().samples
    ours(8)
    mine, fast = timed(lambda: ours(samples), 7)
    print(f"-- {samples} samples, step {STEP:g} h, noise {NOISE:g} per √h")
    line("simulate_lives", fast, mine)
    print(f"{'predict_life, all laws, 50 values':34s} {1e3 * closed_form():10.1f} ms")
    good = fast <= 0.2
    if find_spec("progpy") is None:
        print("ProgPy is not installed: pip install 'evertwin[bench]'")
        return 0 if good else 1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs, slow = timed(lambda: progpy(samples), 1)
    line("ProgPy MonteCarlo", slow, theirs)
    print(f"{slow / fast:.0f} x as fast at equal samples, step and noise; asked: 10 x, and 0.2 s")
    low, high = np.quantile(mine, [0.1, 0.9])
    alike = abs(np.median(mine) - np.median(theirs)) < 0.15 * (high - low) + STEP
    return 0 if good and alike and slow >= 10.0 * fast else 1


if __name__ == "__main__":
    sys.exit(main())
