"""The arm against an independent engine: `python -m proofs.verification [--arms 100]`.

Random serial arms from Denavit-Hartenberg tables, three to seven joints, one of them sliding, with
rotor inertia, friction, a payload, motor constants and a random coupling of the motors, each in
place of the arm of `twins/arm.toml`. `Twin.validate` compares the model as it runs with MuJoCo and
holds it to the laws of power, energy and momentum. Worst figures over all arms, beside what is
asked. Then two URDF files, each read by ourselves and by MuJoCo's own reader (``kind = "mujoco"``).
"""

from __future__ import annotations

import argparse
import os
import sys
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import Twin
from evertwin.engineering.verification import Check
from evertwin.machines.arm.inertia import NAMES, of_body
from evertwin.models.spec import ModelSpec, ParameterSpec
from planted.arms import table
from planted.twins import opened

ASKED = {"mass matrix against MuJoCo": 1e-12, "gravity against MuJoCo": 1e-12}
"""However large the torques are."""


def twin(kind: str, values: dict[str, float], **options: Any) -> Twin:
    """A twin of nothing but a model."""
    parameters = {name: ParameterSpec(value=value) for name, value in values.items()}
    model = ModelSpec(kind, options, parameters)
    return opened("arm", model=model, moving=None, source=(), tuning={"editable": ()})


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def one(seed: int) -> tuple[Check, ...]:
    """The checks of one random arm."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 8))
    coupling = np.eye(n) + np.tril(rng.uniform(-0.3, 0.3, (n, n)), -1)
    options = {
        "dh": table(rng, n), "law": "tanh+stribeck", "payload": True,
        "motor": rng.uniform(5, 15, n).tolist(), "convention": ("standard", "modified")[seed % 2],
        "coupling": coupling.tolist(), "motion": ("joint", "motor")[seed // 2 % 2],
    }  # fmt: skip
    drives = [f"{name}{j + 1}" for j in range(n) for name in ("Ia", "Fc", "Fv", "Fs")]
    values = {name: float(rng.uniform(0.1, 5.0)) for name in drives}
    body = of_body(rng.uniform(1, 5), rng.uniform(-0.1, 0.1, 3), 0.02 * np.eye(3)).tolist()
    values |= {f"payload.{name}": value for name, value in zip(NAMES, body, strict=True)}
    with twin("arm", values, **options) as arm:
        names = (*arm.model.inputs.names, *arm.model.outputs.names)
        motion = rng.uniform(-1.5, 1.5, (200, 3 * n))
        columns = np.hstack([motion, np.zeros((200, len(names) - 3 * n))]).T
        rows = {"t": 0.01 * np.arange(200), **dict(zip(names, columns, strict=True))}
        return tuple(c for c in arm.validate([rows]).verification.checks if c.ran)


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
    mujoco = {"file": str(path), "inverse": True}
    with twin("arm", {}, urdf=str(path)) as own, twin("mujoco", {}, **mujoco) as their:
        u = np.random.default_rng(0).uniform(-2, 2, (1000, len(own.model.inputs)))
        torques = []
        for model in (own.model, their.model):
            p = np.zeros(len(model.parameters))
            torques.append(model.simulate(np.zeros(0), u, np.zeros(1000), p)[1])
    off = float(np.abs(torques[1] - torques[0]).max())
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
