"""Whether a correction tells the numbers of its machine: `python -m proofs.true_numbers [SEEDS]`.

A robot on the plane (`planted/losing.py`), whose wheels lose what is slow or cap what is fast from
the middle of ten minutes on. Asked in each run: the gain, which did not change, within 2 % and not
told again by the law, the law's own number within 5 %, what is left below 6 mm; and of the law's
intervals three in four hold what was planted.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from evertwin import Twin
from planted.losing import GAIN, NUMBERS, driven, plane
from proofs._verdict import ended


def asked(kind: str, seeds: int) -> dict[str, bool]:
    """Runs all seeds and prints a line."""
    name, true = NUMBERS[kind]
    found = []
    for seed in range(seeds):
        result = Twin(plane()).run(driven(seed, kind))
        told: Any = result.to_dict()["parameters"]
        if name not in told:
            found.append((np.inf, np.inf, np.inf, 0.0))
            continue
        low, high = told[name]["interval95"] or (np.nan, np.nan)
        gain = abs(told["gain"]["value"] / GAIN - 1.0) + abs(told["law.v.gain"]["value"] - 1.0)
        left = max(result.outputs[k].rms_after for k in ("x", "y"))
        found.append((gain, abs(told[name]["value"] / true - 1.0), left, float(low < true < high)))
    gains, numbers, left, held = np.array(found).T
    sys.stdout.write(
        f"{kind:10} {seeds} runs: gain off by {100 * gains.max():.2f} % at most, {name} by "
        f"{100 * numbers.max():.1f} %, left {1e3 * left.max():.1f} mm, held {held.mean():.0%}\n"
    )
    return {
        f"{kind}: the gain": bool(gains.max() < 0.02),
        f"{kind}: the law's number": bool(numbers.max() < 0.05),
        f"{kind}: what is left": bool(left.max() < 0.006),
        f"{kind}: intervals": bool(held.mean() >= 0.75),
    }


def main(seeds: int = 20) -> int:
    """Exit code 0 if all that is asked was reached."""
    demands: dict[str, bool] = {}
    for kind in NUMBERS:
        demands |= asked(kind, seeds)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2])))
