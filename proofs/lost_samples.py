"""Samples that were lost on the way to a derivative: `python -m proofs.lost_samples [SEEDS]`.

The plain axes of `planted/axes.py`, position and force alone, on a grid and differentiated as
`twins/emps.toml` does, with and without its filter. Of the rows 1 to 20 % are lost one by one, in
bursts of 5 to 50, or a tenth of them at once. Asked: the largest error of the four numbers stays
within twice that of the whole recording, or within 1 %, in 90 %.
"""

from __future__ import annotations

import sys

import numpy as np

from evertwin.config.spec import ClockSpec, FilterSpec
from planted.axes import Axis, drawn, kept
from planted.twins import opened
from proofs._verdict import ended

HOW = ("random 1 %", "random 5 %", "random 20 %", "bursts", "gap", "random 5 %, gap")
ENOUGH = 0.01


def error(axis: Axis, stays: np.ndarray, smooth: bool) -> float:
    """Largest error of the axis' numbers from these rows, in parts of the dry friction."""
    told = {name: axis.columns[name][stays] for name in ("t", "position", "force")}
    rate = 1.0 / float(np.median(np.diff(axis.columns["t"])))
    rule = FilterSpec(cutoff=rate / 8.0, inputs=("position",)) if smooth else None
    twin = opened(
        "emps", filter=rule, clock=ClockSpec(rate=rate), moving={"above": 0.005 * axis.top}
    )
    found = {item.name: item.value for item in twin.fit(told).parameters}
    return max(
        abs(found[name] - value) / abs(value)
        for name, value in axis.truth.items()
        if name != "offset"  # small beside the others
    )


def main() -> int:
    """Prints the counts; exit code 1 if a demand is missed."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    demands: dict[str, bool] = {}
    for smooth in (False, True):
        way = "filtered" if smooth else "as it is"
        axes = [drawn("plain", seed) for seed in range(seeds)]
        whole = [error(axis, np.ones(len(axis.columns["t"]), bool), smooth) for axis in axes]
        print(f"{way:9s} {'whole':16s} median {np.median(whole):6.2%}, 95 % below "
              f"{np.quantile(whole, 0.95):6.2%}", flush=True)  # fmt: skip
        for how in HOW:
            found = [
                error(axis, kept(how, len(axis.columns["t"]), seed), smooth)
                for seed, axis in enumerate(axes)
            ]
            good = [a <= max(2.0 * b, ENOUGH) for a, b in zip(found, whole, strict=True)]
            share = float(np.mean(good))
            print(f"{way:9s} {how:16s} median {np.median(found):6.2%}, 95 % below "
                  f"{np.quantile(found, 0.95):6.2%}; within twice the whole's: {share:.0%}",
                  flush=True)  # fmt: skip
            demands[f"{way}, {how}"] = share >= 0.9
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
