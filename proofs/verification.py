"""The arm against an independent engine: `python -m proofs.verification [--arms 100]`.

Random serial arms from Denavit-Hartenberg tables, three to seven joints, one of them sliding, with
rotor inertia, friction, a payload, motor constants and a random coupling of the motors. The model
as it runs is compared with MuJoCo and held to the laws of power, energy and momentum
(`evertwin.engineering.verify_arm`). Worst figures over all arms, beside what is asked. Then two
URDF files, each read by ourselves and by MuJoCo's own reader.
"""

from __future__ import annotations

import argparse
import os
import sys
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.engineering.verification import Check
from evertwin.engineering.verify_arm import verify_arm
from evertwin.machines.arm import Arm
from evertwin.machines.arm.inertia import of_body
from evertwin.machines.arm.lanes import batch
from evertwin.machines.catalog import machine

ASKED = {"mass matrix against MuJoCo": 1e-12, "gravity against MuJoCo": 1e-12}
"""However large the torques are."""


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def table(rng: np.random.Generator, n: int) -> list[dict[str, Any]]:
    """A random arm: half-metre links of one to ten kilograms."""
    rows = []
    for i in range(n):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        own = turn @ np.diag(rng.uniform(0.02, 0.03, 3)) @ turn.T
        rows.append({
            "a": rng.uniform(-0.5, 0.5), "alpha": rng.uniform(-2, 2), "d": rng.uniform(-0.3, 0.3),
            "theta": rng.uniform(-2, 2), "kind": "prismatic" if i == n // 2 else "revolute",
            "mass": rng.uniform(1, 10), "com": rng.uniform(-0.2, 0.2, 3).tolist(),
            "inertia": [*np.diag(own).tolist(), own[0, 1], own[0, 2], own[1, 2]],
        })  # fmt: skip
    return rows


def one(seed: int) -> tuple[Check, ...]:
    """The checks of one random arm."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 8))
    coupling = np.eye(n) + np.tril(rng.uniform(-0.3, 0.3, (n, n)), -1)
    arm = Arm.of(
        dh=table(rng, n), law="tanh+stribeck", payload=True, motor=rng.uniform(5, 15, n).tolist(),
        convention=("standard", "modified")[seed % 2], coupling=coupling.tolist(),
        motion=("joint", "motor")[seed // 2 % 2],
    )  # fmt: skip
    p, names = arm.parameters.values, arm.parameters.names
    for j in range(n):
        for name in ("Ia", "Fc", "Fv", "Fs"):
            p[names.index(f"{name}{j + 1}")] = rng.uniform(0.1, 5.0)
    first = names.index("payload.m")
    p[first : first + 10] = of_body(rng.uniform(1, 5), rng.uniform(-0.1, 0.1, 3), 0.02 * np.eye(3))
    return verify_arm(arm, rng.uniform(-1.5, 1.5, (200, 3 * n)), p)


def arms(count: int) -> bool:
    """Prints the worst figures over ``count`` arms."""
    found = [one(seed) for seed in range(count)]
    say(f"-- {count} random arms: worst of all, and what is asked")
    good = True
    for checks in zip(*found, strict=True):
        worst = max(checks, key=lambda check: check.figure)
        asked = ASKED.get(worst.name, worst.limit)
        failed = sum(not (check.passed and check.figure <= asked) for check in checks)
        good &= failed == 0
        unit = "" if worst.unit == "1" else worst.unit
        say(f"{worst.name:<34}{worst.figure:10.2e} <= {asked:.0e} {unit:<5} missed {failed}")
    return good


def read_twice(name: str, path: Path) -> bool:
    """Prints how far our reading of a URDF is from MuJoCo's own."""
    chain = Arm.of(path).chain
    engine: Any = machine("mujoco", {"file": path, "inverse": True})
    p = engine.parameters.with_values(dict.fromkeys(engine.parameters.names, 0.0)).values
    u = np.random.default_rng(0).uniform(-2, 2, (1000, 3 * chain.n))
    _, theirs = engine.simulate(np.zeros(0), u, np.zeros(1000), p)
    off = float(np.abs(theirs - batch(chain.geometry, chain.inertia, u)).max())
    say(f"{name:<34}{off:10.2e} <= 1e-07 Nm")
    return off <= 1e-7


def main() -> int:
    """Exit code 0 if nothing is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=100)
    good = [arms(parser.parse_args().arms)]
    say("-- URDF files, read by ourselves and by MuJoCo; largest difference of 1000 torques")
    with as_file(files("evertwin.machines") / "data" / "ur5_like.urdf") as path:
        good.append(read_twice("ur5_like.urdf", path))
    real = Path(os.environ.get("EVERTWIN_DATA", "")) / "ur10e" / "ur10e.urdf"
    if real.is_file():
        good.append(read_twice("ur10e.urdf", real))
    else:
        say("ur10e.urdf: EVERTWIN_DATA is not set")
    say("all reached" if all(good) else "MISSED")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
