"""Which parameters of the welding arm are tuned: `python -m proofs.p2_choice [SEEDS]`.

The breakdown file of the embedded 6-axis arm (`twins/breakdowns/arm.toml`: ratio, Coulomb and
viscous friction of six gearboxes, rotor inertia of six motors) goes through the method of
Aivaliotis, Arkouli, Georgoulias, Makris (2023) as `evertwin engineer` does. Printed: the choice on
the first recording, every parameter with its reason, and what the schedule saves; then, over the
seeds, how often exactly the six Coulomb torques are chosen. A seed draws the noise of the recording
and the samples of the sensitivity analysis.

Ends with 1 if another set than the six Coulomb torques is ever chosen.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin.engineering.engineer import Engineered, engineer
from planted.twins import TWINS
from planted.worlds import record_arm

FILE = TWINS / "breakdowns" / "arm.toml"
COULOMB = {f"gearbox{k}.Fc" for k in range(1, 7)}
VISCOUS = {f"gearbox{k}.Fv" for k in range(1, 7)}
LIMITS = (0.02, 0.05, 0.1, 0.2)


def show(done: Engineered) -> None:
    """The choice, and what the schedule saves."""
    for one in done.study.chosen.choices:
        print(f"{one.name:<16}{'tune' if one.editable else 'keep'}  {one.reason}")
    measured = done.study.measured
    if measured is not None:
        print(
            f"schedule over {measured.tunings} tunings: {measured.count} instead of "
            f"{measured.count_all} parameters tuned, run time {measured.saved:.0%} saved, by "
            f"rounds {measured.simulations} instead of {measured.simulations_all} single-axis "
            f"simulations ({measured.saved_simulations or 0.0:.0%} saved), largest loss of "
            f"accuracy {100 * measured.lost:.2f} points, largest deviation "
            f"{100 * max(measured.deviation.values()):.2f} %"
        )


def main() -> int:
    """Exit code 0 if every seed chooses the six Coulomb torques."""
    seeds, right = int(sys.argv[1]) if len(sys.argv) > 1 else 20, 0
    viscous, coulomb = [], []
    with tempfile.TemporaryDirectory() as folder:
        cycles, twin = Path(folder) / "cycles", Path(folder) / "arm.toml"
        record_arm(cycles, "--cycles", str(seeds))
        for seed, file in enumerate(sorted(cycles.glob("*.csv"))):
            done = engineer(FILE, twin, [file], seed)
            if seed == 0:
                show(done)
            shares = {one.name: one.share or 0.0 for one in done.study.chosen.choices}
            right += {one.name for one in done.study.chosen.choices if one.editable} == COULOMB
            viscous.append(max(shares[name] for name in VISCOUS))
            coulomb.append(min(shares[name] for name in COULOMB))
    print(
        f"{seeds} seeds: the six Coulomb torques, and no other parameter, in {right}; largest "
        f"share of a viscous term {max(viscous):.4f} (median {np.median(viscous):.4f}), smallest "
        f"share of a Coulomb torque {min(coulomb):.3f}"
    )
    for limit in LIMITS:
        same = sum(a < limit <= b for a, b in zip(viscous, coulomb, strict=True))
        print(f"  with shares below {limit:g} negligible: the same set in {same}")
    return int(right < seeds)


if __name__ == "__main__":
    sys.exit(main())
