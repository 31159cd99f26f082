"""A sensor that is wrong for a while, or a machine that changed: `python -m proofs.gauges [SEEDS]`.

`twins/template.toml`, a model in a Python file, as it is shipped, beside tanks whose area, outlet,
noise and inflow are drawn by seed. Each runs for 2,500 s and is learned; then for 600 s its level
is in feet, its sensor stays where it is (to a fifth of its noise), or is off by a constant; or its
outlet, or its area, is another one from then on. Told: an event names the sensor, or says that it
cannot be told from the machine. Learned: a version that went live on rows of the fault, or, of a
machine that changed, since then. Where the twin stays within the 2 cm that are asked, nothing has
to be told or learned: *beyond* counts the others.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from evertwin import RunResult
from planted.twins import opened
from proofs._verdict import ended

ROWS, AT, LONG = 4000, 2500, 600
TOLD = {"factor", "frozen", "away"}
"""Causes by which the arbiter tells of a sensor."""
Wrong = Callable[[np.ndarray, np.random.Generator], np.ndarray]
FAULTS: dict[str, Wrong] = {
    "feet for metres": lambda y, _: 3.28084 * y,
    "stays where it is": lambda y, rng: y[0] + rng.normal(0.0, 0.0005, len(y)),
    "off by a constant": lambda y, rng: y + rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.2),
}
CHANGES = {"outlet wider by 40 %": ("outlet", 1.4), "area smaller by 40 %": ("area", 0.6)}


class Tank(NamedTuple):
    """A machine of one seed."""

    area: float
    outlet: float
    noise: float


def driven(rng: np.random.Generator, tank: Tank, change: tuple[str, float] | None) -> Any:
    """Its inflow and its level."""
    inflow = np.empty(ROWS)
    k = 0
    while k < ROWS:
        hold = int(rng.integers(20, 120))
        inflow[k : k + hold] = rng.uniform(100.0, 450.0) / 60_000.0
        k += hold
    level = np.empty(ROWS)
    level[0], now = 0.3, tank
    for k in range(1, ROWS):
        if k == AT and change is not None:
            now = tank._replace(**{change[0]: change[1] * getattr(tank, change[0])})
        h = level[k - 1]
        for _ in range(10):
            h = max(h + 0.1 * (inflow[k - 1] - now.outlet * np.sqrt(h)) / now.area, 0.0)
        level[k] = h
    return inflow, level


def run(seed: int, fault: Wrong | None, change: tuple[str, float] | None) -> tuple[RunResult, int]:
    """The twin beside one machine, and the row at which something happened to it."""
    rng = np.random.default_rng([7, seed])
    tank = Tank(rng.uniform(0.3, 0.8), rng.uniform(0.012, 0.025), rng.uniform(0.001, 0.003))
    inflow, level = driven(rng, tank, change)
    y, at = level + rng.normal(0.0, tank.noise, ROWS), AT
    if fault is not None:
        at += int(rng.integers(-150, 150))
        y[at : at + LONG] = fault(y[at : at + LONG], rng)
    data = {"t": np.arange(ROWS, dtype=float), "pump": inflow, "level": y}
    with opened("template") as twin:
        return twin.run(data), at


def told(result: RunResult, at: int) -> list[int]:
    """Rows of events that name the sensor, since it is wrong."""
    found = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    found += [
        e for e in result.of_kind("measurement_error") if str(e.evidence.get("cause")) in TOLD
    ]
    return sorted(e.row - at for e in found if e.row >= at)


def learned(result: RunResult, at: int, stop: int) -> bool:
    """Did a version go live between two rows?"""
    return any(at <= event.row < stop for event in result.of_kind("promoted"))


def beyond(result: RunResult, at: int) -> bool:
    """Was the twin off by more than is asked since then, or the sensor told at once?"""
    return bool(told(result, at)) or any(e.row >= at for e in result.of_kind("suspected"))


def main(seeds: int = 30) -> int:
    """Exit code 0 where all was reached."""
    print(f"{seeds} tanks each: beyond what is asked, told, after (median), learned")
    demands = {}
    for name, fault, change in (
        ("nothing happens", None, None),
        *((name, fault, None) for name, fault in FAULTS.items()),
        *((name, None, change) for name, change in CHANGES.items()),
    ):
        found = [run(seed, fault, change) for seed in range(seeds)]
        rows = [told(result, at) for result, at in found]
        live = sum(learned(r, at, ROWS if fault is None else at + LONG) for r, at in found)
        named = [one[0] for one in rows if one]
        off = sum(beyond(*one) for one in found)
        after = f"{np.median(named):.0f} s" if named else "-"
        print(f"   {name:22} {off:3}, {len(named):3}, {after:>6}, {live:3}", flush=True)
        if fault is not None:
            demands[f"{name}: told in 90 %"] = len(named) >= 0.9 * off
            demands[f"{name}: learned in at most 5 %"] = live <= 0.05 * seeds
        elif change is None:
            demands[f"{name}: nothing told"] = not named
            demands[f"{name}: nothing learned"] = live == 0
        else:
            demands[f"{name}: learned in 90 %"] = live >= 0.9 * off
    return ended(demands)


if __name__ == "__main__":
    raise SystemExit(main(*map(int, sys.argv[1:2])))
