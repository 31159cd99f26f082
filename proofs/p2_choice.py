"""Which parameters of the welding arm are tuned: `python -m proofs.p2_choice [--seeds 200]`.

The breakdown file of the embedded 6-axis arm (`twins/breakdowns/arm.toml`: ratio, Coulomb and
viscous friction of six gearboxes, rotor inertia of six motors; MuJoCo, 40 cm circle, 69 s at 10 Hz)
goes through the method of Aivaliotis, Arkouli, Georgoulias, Makris (2023). Printed:

1. the choice at the file's initial values (Coulomb friction 50 % off), every parameter with its
   reason, and the Sobol shares of the six viscous terms over ± 50 % around the true values, on all
   rows and on moving ones;
2. over the seeds: how often exactly the six Coulomb torques are chosen. A seed draws the torque
   noise of the world, encoder noise on speed and acceleration, initial values of friction anywhere
   in ± 50 % of the truth, and the samples of the sensitivity analysis;
3. the same over different limits of what counts as negligible;
4. the schedule: parameters tuned, run time and accuracy with and without weights.

Ends with 1 if another set than the six Coulomb torques is ever chosen.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from evertwin.engineering.breakdown import Breakdown, read_breakdown
from evertwin.engineering.choice import choose, questions, spans_of
from evertwin.engineering.compile import compile_model
from evertwin.engineering.criticality import history_of, rank
from evertwin.engineering.level import level_of
from evertwin.engineering.mapping import links
from evertwin.engineering.sensitivity import sobol
from evertwin.engineering.study import modelled, study
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.tuning import Problem
from proofs.p2_rounds import block

FILE = Path(__file__).parent.parent / "twins" / "breakdowns" / "arm.toml"
TRUE = {"Fc": (12.0, 14.0, 10.0, 3.0, 3.0, 2.5), "Fv": (10.0, 10.0, 8.0, 2.0, 2.0, 2.0)}
NOISE = np.array([0.5, 0.8, 0.5, 0.08, 0.08, 0.06])
SPEED, ACCELERATION = 0.002, 0.02
"""Encoder noise [rad/s], [rad/s²]."""
COULOMB = {f"gearbox{k}.Fc" for k in range(1, 7)}
VISCOUS = tuple(f"gearbox{k}.Fv" for k in range(1, 7))
LIMITS = (0.02, 0.05, 0.1, 0.2)


def recorded() -> Block:
    """One cycle without noise."""
    with tempfile.TemporaryDirectory() as folder:
        with as_file(files("evertwin.machines") / "data" / "ur5_like.urdf") as urdf:
            command = [sys.executable, "-m", "evertwin.worlds.arm", "--urdf", str(urdf)]
            subprocess.run([*command, "--seed", "1", "--out", folder], check=True)
        rows = block(next(Path(folder).glob("*.csv")))
    noise = NOISE * np.random.default_rng([1, 0]).standard_normal(rows.y.shape)
    return rows._replace(y=rows.y - noise)


def posed(breakdown: Breakdown, rows: Block, values: dict[str, float]) -> Problem:
    """The tuning problem on every parameter of the breakdown, started at ``values``."""
    plan = compile_model(breakdown)
    model: Model = plan.model(breakdown.folder)
    stated = {name: float(entry["value"]) for name, entry in plan.parameters.items()}  # type: ignore[arg-type]
    prior = model.parameters.with_values(stated | values)
    names = modelled(breakdown, model.parameters.names)
    return Problem(model, (rows,), names, prior=prior, moving=lambda u: np.abs(u[:, 6:12]) > 0.05)


def true_values() -> dict[str, float]:
    """The friction that the world has."""
    return {f"gearbox{k + 1}.{n}": v for n, row in TRUE.items() for k, v in enumerate(row)}


def noisy(rows: Block, seed: int) -> Block:
    """The cycle as a seed measures it."""
    rng = np.random.default_rng([7, seed])
    u = rows.u.copy()
    u[:, 6:12] += SPEED * rng.standard_normal((len(u), 6))
    u[:, 12:] += ACCELERATION * rng.standard_normal((len(u), 6))
    return rows._replace(u=u, y=rows.y + NOISE * rng.standard_normal(rows.y.shape))


def shown(breakdown: Breakdown, rows: Block) -> None:
    """Prints the choice, the shares around the truth, and the schedule."""
    problem = posed(breakdown, noisy(rows, 0), {})
    found = study(breakdown, problem)
    for one in found.chosen.choices:
        sys.stdout.write(f"{one.name:<16}{'tune' if one.editable else 'keep'}  {one.reason}\n")
    around = replace(posed(breakdown, noisy(rows, 0), true_values()), editable=tuple(true_values()))
    for label, moving in (("all rows", None), ("moving rows", around.moving)):
        asked = replace(around, moving=moving)
        shares = sobol(asked, spans_of(asked, found.questions), 1)
        own = [shares.share[:, shares.names.index(name)].max() for name in VISCOUS]
        sys.stdout.write(
            f"Sobol shares of the viscous terms, ± 50 % around the truth, {label}: "
            f"{np.array2string(np.array(own), precision=4)}, largest {max(own):.4f} "
            f"({shares.samples} samples, {shares.seconds:.2f} s)\n"
        )
    measured = found.measured
    if measured is not None:
        sys.stdout.write(
            f"schedule over {measured.tunings} tunings: {measured.count} instead of "
            f"{measured.count_all} parameters tuned, run time {1e3 * measured.seconds:.1f} instead "
            f"of {1e3 * measured.seconds_all:.1f} ms ({measured.saved:.0%} saved), by rounds "
            f"{measured.simulations} instead of {measured.simulations_all} single-axis simulations "
            f"({measured.saved_simulations or 0.0:.0%} saved), largest loss of accuracy "
            f" {100 * measured.lost:.2f} points, largest deviation "
            f"{100 * max(measured.deviation.values()):.2f} %\n"
        )


def counted(breakdown: Breakdown, rows: Block, seeds: int) -> int:
    """Prints how often which set is chosen; the seeds that chose another one."""
    ranks = rank(breakdown, history_of(breakdown))
    levels = {r.component: level_of(breakdown.component(r.component), r.role) for r in ranks}
    sets: Counter[frozenset[str]] = Counter()
    shares: list[tuple[float, float]] = []
    for seed in range(seeds):
        rng = np.random.default_rng([8, seed])
        start = {name: v * float(rng.uniform(0.5, 1.5)) for name, v in true_values().items()}
        problem = posed(breakdown, noisy(rows, seed), start)
        asked = questions(breakdown, levels, links(problem))
        chosen = choose(problem, asked, breakdown.requirements.negligible, seed)
        sets[frozenset(chosen.editable)] += 1
        known = {one.name: one.share or 0.0 for one in chosen.choices}
        shares.append((max(known[n] for n in VISCOUS), min(known[n] for n in COULOMB)))
    right = sets[frozenset(COULOMB)]
    viscous, coulomb = np.array(shares).T
    sys.stdout.write(
        f"{seeds} seeds: the six Coulomb torques, and no other parameter, in {right}; largest "
        f"share of a viscous term {viscous.max():.4f} (median {np.median(viscous):.4f}), smallest "
        f"share of a Coulomb torque {coulomb.min():.3f}\n"
    )
    for limit in LIMITS:
        same = int(((viscous < limit) & (coulomb >= limit)).sum())
        sys.stdout.write(f"  with shares below {limit:g} negligible: the same set in {same}\n")
    return seeds - right


def main() -> int:
    """Exit code 0 if every seed chooses the six Coulomb torques."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    seeds = parser.parse_args().seeds
    breakdown, rows = read_breakdown(FILE), recorded()
    shown(breakdown, rows)
    return int(counted(breakdown, rows, seeds) > 0)


if __name__ == "__main__":
    sys.exit(main())
