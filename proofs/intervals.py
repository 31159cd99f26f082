"""Intervals where the form is wrong: `python -m proofs.intervals [SEEDS [EFFECT ...]]`.

`Twin.fit` on `twins/emps.toml`, told the motion itself, on the axes of `planted/axes.py`: each has
one effect that the textbook law (mass, viscous, dry friction, constant) lacks. Counted, over the
numbers that both forms share by meaning: 95 % intervals that hold the truth, numbers refused
(*not*) or weak, and the width beside that of a fit of the true form, which knows its shape.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np

from evertwin.config.spec import ClockSpec
from planted.axes import EFFECTS, Axis, drawn
from planted.twins import opened
from proofs._verdict import ended


class Row(NamedTuple):
    """One number of one axis."""

    name: str
    held: bool
    verdict: str
    wider: float
    """Half width over that of the true form's own fit."""


def counted(axis: Axis) -> list[Row]:
    """The numbers of an axis beside the truth."""
    moving = {"above": 0.005 * axis.top}
    twin = opened("emps", derive=(), filter=None, clock=ClockSpec(), moving=moving)
    told: Any = twin.fit(axis.columns).to_dict()["parameters"]
    found: list[Row] = []
    for name, truth in axis.truth.items():
        if name not in told:  # put back and left out of the fit
            found.append(Row(name, True, "not", np.inf))
            continue
        one = told[name]
        low, high = (np.inf if end is None else end for end in one["interval95"] or (None, None))
        half = (high - low) / 2 if one["verdict"] != "not" else np.inf
        found.append(Row(name, low <= truth <= high, one["verdict"], half / axis.own[name]))
    return found


def line(effect: str, rows: list[Row]) -> dict[str, float]:
    """Prints an effect's counts."""
    said = [row for row in rows if row.verdict != "not"]
    found = {
        "held": float(np.mean([row.held for row in said])) if said else 1.0,
        "refused": 1.0 - len(said) / len(rows),
        "weak": float(np.mean([row.verdict == "weak" for row in rows])),
        "wider": float(np.median([row.wider for row in rows])),
    }
    print(f"{effect:12s} {len(rows):5d} numbers: held {found['held']:4.0%}, refused "
          f"{found['refused']:4.0%}, weak {found['weak']:4.0%}, width {found['wider']:6.2f} x; "
          + ", ".join(f"{n} {np.mean([r.held for r in said if r.name == n]):.0%}"
                      f" {np.median([r.wider for r in rows if r.name == n]):.1f}x"
                      for n in dict.fromkeys(r.name for r in said)), flush=True)  # fmt: skip
    return found


def main() -> int:
    """Prints the counts; exit code 1 if a demand is missed."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    every: list[Row] = []
    for effect in sys.argv[2:] or EFFECTS:
        rows = [row for seed in range(seeds) for row in counted(drawn(effect, seed))]
        line(effect, rows)
        every += rows
    whole = line("all", every)
    return ended({
        "95 % intervals hold 90 %": whole["held"] >= 0.9,
        "refused in at most 20 %": whole["refused"] <= 0.2,
        "median width at most 3 times the true form's": whole["wider"] <= 3.0,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
