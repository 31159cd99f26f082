"""Intervals where speed and acceleration are derived: `python -m proofs.derived [SEEDS]`.

Axes of which a place and a force are recorded, and nothing else: 1 to 500 kg, with and without
weight, at 20 to 500 Hz, moved smoothly or in steps, the place scattered or rounded over two and a
half decades. Each goes through `evertwin init` and `Twin.fit`, unasked. Counted are, of the numbers
that are told as "identifiable", the 95 % intervals that hold the truth; and how many are told so.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from evertwin import Twin
from evertwin.types import Vector
from proofs._verdict import ended

ROWS, FINE = 6000, 10
"""Rows, at most, and steps of the world in each."""
HELD = 0.9
"""Share of intervals that has to hold."""


class World(NamedTuple):
    """An axis: what is recorded of it, and what it is."""

    columns: Vector
    truth: dict[str, float]


def motion(rng: np.random.Generator, t: Vector, top: float) -> tuple[Vector, Vector]:
    """Speed and acceleration."""
    step = t[1] - t[0]
    if rng.random() < 0.5:
        w, phase = 2 * np.pi * rng.uniform(0.1, 1.0, 4), rng.uniform(0.0, 2 * np.pi, 4)
        part = rng.uniform(0.5, 1.0, 4)
        part *= 1.5 * top / part.sum()
        angle = w[:, None] * t + phase[:, None]
        return part @ np.sin(angle), (part * w) @ np.cos(angle)
    tau, hold = rng.uniform(0.05, 0.2), int(rng.uniform(0.5, 2.0) / step)
    wanted = np.repeat(rng.uniform(-top, top, len(t) // hold + 1), hold)[: len(t)]
    v = scipy.signal.lsim(([1.0], [tau**2 / 4, tau, 1.0]), wanted, t)[1]
    return v, np.gradient(v, step)


def drawn(seed: int) -> World:
    """An axis of its own size, friction, rate and noise."""
    rng = np.random.default_rng(seed)
    mass, rate = 10 ** rng.uniform(0.0, np.log10(500.0)), rng.choice([20, 50, 100, 200, 500])
    n = int(np.clip(60 * rate, 2400, ROWS))
    t = np.arange(n * FINE) / (rate * FINE)
    v, a = motion(rng, t, 10 ** rng.uniform(-1.0, 0.3))
    x = np.cumsum(v) * t[1] - 0.5 * t[1] * v
    t, x, v, a = (one[::FINE] for one in (t, x, v, a))
    size = mass * a.std()
    truth = {
        "mass": mass, "Fc": size * 10 ** rng.uniform(-1.0, 0.5),
        "Fv": size / v.std() * 10 ** rng.uniform(-1.0, 0.3),
        "offset": 9.81 * mass * (rng.random() < 0.4),
    }  # fmt: skip
    force = mass * a + truth["Fc"] * np.sign(v) + truth["Fv"] * v + truth["offset"]
    force += rng.normal(0.0, 0.02 * force.std(), n)
    noise = v.std() * 10 ** rng.uniform(-4.5, -2.0)
    if rng.random() < 0.5:
        x = x + rng.normal(0.0, noise, n)
    else:
        x = np.round(x / (noise * np.sqrt(12))) * (noise * np.sqrt(12))
    return World(np.column_stack([t, x, force]), truth)


def told(world: World, folder: Path) -> list[tuple[str, str, bool]]:
    """Name, verdict, and whether the interval holds the truth."""
    file, head = folder / "axis.csv", "time [s],position [m],force [N]"
    np.savetxt(file, world.columns, "%.9g", ",", header=head, comments="")
    words = [sys.executable, "-m", "evertwin", "init", file.name, "-o", "axis.toml", "--force"]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    fit = Twin(folder / "axis.toml").fit(file).fit
    rows = zip(fit.names, fit.verdict, fit.interval95.tolist(), strict=True)
    truth = world.truth
    return [(n, word, low <= truth[n] <= high) for n, word, (low, high) in rows if n in truth]


def main(seeds: int = 100) -> int:
    """Prints the counts; exit code 1 if fewer intervals hold than asked."""
    found: list[tuple[str, str, bool]] = []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(seeds):
            found += told(drawn(seed), Path(name))
    print(
        f"{sum(name == 'mass' for name, _, _ in found)} of {seeds} axes are known as such by init"
    )
    shares = {}
    for name in ("mass", "Fc", "Fv", "offset", "all"):
        rows = [row for row in found if name in ("all", row[0])]
        sure = [holds for _, word, holds in rows if word == "identifiable"]
        shares[name] = np.mean(sure) if sure else 1.0
        print(f"{name:6s} {len(rows):4d} numbers: {len(sure) / max(len(rows), 1):4.0%} told as "
              f"identifiable, of these {shares[name]:4.0%} held")  # fmt: skip
    return ended({f"held {shares['all']:.0%} of {HELD:.0%}": bool(shares["all"] >= HELD)})


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
