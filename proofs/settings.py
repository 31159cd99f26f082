"""Settings halved and doubled: `python -m proofs.settings [SEEDS]`.

The drives of `proofs.rates` at 10 Hz, drawn anew for each seed, with `twins/robot1d.toml` as it is
and with one setting halved or doubled: the beat, the horizon, the window that the requirement is
judged over, and those that a fit and a correction look at. The requirement is 1 cm after a horizon;
so that the same is asked of half the horizon it is also halved with it. Asked for each: the same
form of the model from the same verdict in 95 % of the seeds, and half to twice the time until live.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.config.spec import Span
from planted.twins import shipped
from proofs._verdict import ended
from proofs.rates import Outcome, outcome, recording

ENOUGH = 0.95


def changed(spec: TwinSpec, setting: str, factor: float) -> TwinSpec:
    """The twin file with one setting times ``factor``."""
    section, _, key = setting.partition(".")
    owner: Any = getattr(spec, section) if key else spec
    value = getattr(owner, key or section)
    scaled = (
        replace(value, seconds=factor * (value.seconds or 0.0))
        if isinstance(value, Span)
        else factor * value
    )
    owner = replace(owner, **{key or section: scaled})
    return replace(spec, **{section: owner}) if key else owner


def settings(spec: TwinSpec) -> Mapping[str, TwinSpec]:
    """By what was changed."""
    names = ("beat", "prediction.horizon", "anomaly.window", "tuning.window", "correction.window")
    found = {}
    for word, factor in (("halved", 0.5), ("doubled", 2.0)):
        found |= {f"{name} {word}": changed(spec, name, factor) for name in names}
        of_way = changed(spec, "anomaly.requirement", factor)
        found[f"horizon, requirement {word}"] = changed(of_way, "prediction.horizon", factor)
    return found


def verdict(one: Outcome) -> str:
    """The last one before it went live."""
    told = [kind for kind in one.verdicts if kind in ("normal", "abnormal")]
    return told[-1] if told else ""


def found(spec: TwinSpec, seed: int) -> Outcome:
    """What the run of one drive came to."""
    with Twin(spec) as twin:
        return outcome(twin.run(recording(seed, 10)))


def main(seeds: int) -> int:
    """A line per setting."""
    spec = shipped("robot1d")
    usual = [found(spec, seed) for seed in range(seeds)]
    print(f"as shipped: live in {np.mean([np.isfinite(one.live) for one in usual]):.0%}, "
          f"after {np.median([one.live for one in usual]):.0f} s (median)", flush=True)  # fmt: skip
    demands = {}
    for name, other in settings(spec).items():
        outcomes = [found(other, seed) for seed in range(seeds)]
        pairs = list(zip(usual, outcomes, strict=True))
        verdicts = float(np.mean([verdict(one) == verdict(two) for one, two in pairs]))
        form = float(np.mean([one.form == two.form for one, two in pairs]))
        ratio = np.array([two.live / one.live if two.live != one.live else 1.0
                          for one, two in pairs])  # fmt: skip
        near = float(np.mean((ratio >= 0.5) & (ratio <= 2.0)))
        print(f"{name:28s} same verdict {verdicts:4.0%}, same form {form:4.0%}, "
              f"within a factor of two {near:4.0%} (median {np.median(ratio):.2f})",
              flush=True)  # fmt: skip
        demands[name] = min(verdicts, form, near) >= ENOUGH
        for seed, (one, two) in enumerate(pairs):
            if (verdict(one), one.form) != (verdict(two), two.form):
                print(f"   seed {seed}: {two.verdicts}, {two.form}; as shipped {one.verdicts}, "
                      f"{one.form}")  # fmt: skip
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 100))
