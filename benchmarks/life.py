"""A life told beside ProgPy: `python -m benchmarks.life [--samples 1000]`.

Crack-like growth, rate = c·x^1.3 per hour with process noise σ, to the limit 1. `Twin.life` on
`twins/wear.toml` reads a history of 50 hours up to x = 0.5, weighs all its laws and tells what is
left. ProgPy is told law, level and noise, and simulates sample after sample from there on. Medians
and 80 % intervals stand beside each other.

Times are processor time, medians of repeats; ProgPy runs once.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np

from evertwin.prognosis.laws import Life
from planted.histories import Told

NOW, LIMIT, C, POWER, NOISE = 0.5, 1.0, 0.01, 1.3, 0.004
STEP, HORIZON, HOURS, REPEATS = 1.0, 2000.0, 50, 20


def ours() -> tuple[Life, float]:
    """What is left, and the time of an answer [s]."""
    rng, x = np.random.default_rng(1), [NOW]
    for _ in range(HOURS):
        x.append(x[-1] - C * x[-1] ** POWER * STEP + NOISE * rng.standard_normal())
    history = {"h": np.arange(HOURS + 1.0), "wear": np.array(x[::-1])}
    with Told(clock="h", limit=LIMIT) as twin:
        life, times = twin.life(history), []
        for _ in range(REPEATS):
            start = time.process_time()
            twin.life(history)
            times.append(time.process_time() - start)
    if not isinstance(life, Life):
        raise SystemExit(f"no life was told: {life.verdict}, needs {life.needs}")
    return life, float(np.median(times))


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
        default_parameters: ClassVar[dict[str, Any]] = {"x0": {"x": NOW}}

        def dx(self, x: Any, u: Any) -> Any:
            return self.StateContainer({"x": C * np.maximum(x["x"], 0.0) ** POWER})

        def output(self, x: Any) -> Any:
            return self.OutputContainer({"x": x["x"]})

        def event_state(self, x: Any) -> dict[str, Any]:
            return {"worn": (LIMIT - x["x"]) / (LIMIT - NOW)}

        def threshold_met(self, x: Any) -> dict[str, Any]:
            return {"worn": x["x"] >= LIMIT}

    # Its noise is added per step as noise·dt: σ·√Δt over a step is σ/√Δt there.
    model = Growth(process_noise={"x": NOISE / np.sqrt(STEP)})
    start = ScalarData({"x": NOW}, _type=model.StateContainer)
    found = MonteCarlo(model).predict(
        start, lambda t, x=None: model.InputContainer({}), n_samples=samples, dt=STEP,
        horizon=HORIZON, save_freq=HORIZON,
    )  # fmt: skip
    ends = found.time_of_event.key("worn")
    return np.array([np.inf if end is None else end for end in ends], dtype=np.float64)


def line(name: str, seconds: float, quantiles: tuple[float, ...]) -> None:
    """One line of figures."""
    low, half, high = quantiles
    print(
        f"{name:34s} {1e3 * seconds:10.1f} ms   median {half:6.1f} h, 80 % {low:.1f} to {high:.1f}"
    )
    sys.stdout.flush()


def main() -> int:
    """Prints the figures; exit code 1 if ours is not 10 times as fast or takes over 0.2 s."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1000)
    samples = parser.parse_args().samples
    life, fast = ours()
    low, high = life.interval80
    line(f"Twin.life, {HOURS + 1} values, all laws", fast, (low, life.median, high))
    if find_spec("progpy") is None:
        print("ProgPy is not installed: pip install 'evertwin[bench]'")
        return 0 if fast <= 0.2 else 1
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = progpy(samples)
    slow = time.process_time() - start
    line(f"ProgPy MonteCarlo, {samples} samples", slow, tuple(np.quantile(theirs, [0.1, 0.5, 0.9])))
    print(f"{slow / fast:.0f} x as fast; asked: 10 x, and 0.2 s")
    return 0 if fast <= 0.2 and slow >= 10.0 * fast else 1


if __name__ == "__main__":
    sys.exit(main())
