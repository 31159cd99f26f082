"""One tuner, four kinds of model from elsewhere: `python -m proofs.elsewhere [SEEDS] [KIND ...]`.

`Twin.fit` on `twins/mass.toml`, a mass under a force with viscous and dry friction: the Python
function of that file, and in its place an FMU (C, co-simulation, in its child process), a Modelica
file and a MuJoCo model. Per seed the three parameters are planted within ± 30 % of where the search
begins, 5 s of motion at 100 Hz are simulated from rest with new noise (1 mm, 2 mm/s), and the twin
has to find them. Counted is how often a parameter lies inside its 95 % interval, with the 95 %
interval of that share over seeds. Each model is tuned on data of its own kind: what is tested is
the tuner, not the physics.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import Twin
from evertwin.models.spec import ModelSpec
from planted.masses import KNOBS, MODELICA, MUJOCO
from planted.twins import opened, shipped
from tests.models.fmu.native import build

ROWS, RATE = 500, 100
SIGMA = np.array([1e-3, 2e-3])


def kinds(folder: Path) -> dict[str, ModelSpec]:
    """How each is named in a twin file."""
    file = folder / "Mass.mo"
    file.write_text(MODELICA)
    names = ["mass", "fc", "fv"]
    native = {"file": str(build(folder / "fmu")), "outputs": ["x", "v"], "parameters": names}
    return {
        "FMU": ModelSpec("fmu", native),
        "Modelica": ModelSpec("modelica", {"file": str(file), "step": 2.5e-3}),
        "MuJoCo": ModelSpec("mujoco", {"text": MUJOCO.format(step=2.5e-3), "parameters": KNOBS}),
        "Python": shipped("mass").model,
    }


def recorded(twin: Twin, seed: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Columns of a recording, and the parameters that it was made with."""
    rng, model = np.random.default_rng(seed), twin.model
    truth = model.parameters.values * rng.uniform(0.7, 1.3, len(model.parameters))
    force = np.repeat(rng.uniform(-8.0, 8.0, ROWS // 25), 25)
    dt = np.full(ROWS - 1, 1.0 / RATE)
    _, y = model.simulate(model.initial(truth), force[:-1, None], dt, truth)
    y = y + SIGMA * rng.standard_normal(y.shape)
    seen = np.concatenate([np.zeros((1, 2)), y])  # at rest at the origin, which is known
    columns = np.column_stack([np.arange(ROWS) / RATE, force, seen]).T
    return dict(zip(("t", *model.inputs.names, *model.outputs.names), columns)), truth


def proven(name: str, twin: Twin, seeds: range) -> bool:
    """Tunes over all seeds and prints a line per parameter."""
    names: Any = twin.model.parameters.names
    began, inside, errors, failed = time.process_time(), [], [], 0
    for seed in seeds:
        rows, truth = recorded(twin, seed)
        fit = twin.fit(rows).fit
        failed += not fit.converged
        low, high = np.array([fit.interval(one) for one in names]).T
        inside.append((low <= truth) & (truth <= high))
        errors.append(np.abs(np.array([fit[one] for one in names]) / truth - 1.0))
    seconds = (time.process_time() - began) / len(seeds)
    each = np.mean(inside, axis=1)  # parameters of one fit share its noise: seeds are what counts
    share, half = each.mean(), 1.96 * each.std(ddof=1) / np.sqrt(len(each))
    print(
        f"{name:<9} inside their 95 % intervals: {100 * share:.1f} ± {100 * half:.1f} % of "
        f"{np.size(inside)}, {failed} not converged, {1e3 * seconds:.0f} ms a fit"
    )
    for one, held, error in zip(names, np.mean(inside, axis=0), np.array(errors).T, strict=True):
        print(f"  {one:<24} {100 * held:5.1f} %   error {100 * np.median(error):.2f} % (median), "
              f"{100 * error.max():.2f} % (worst)")  # fmt: skip
    return abs(share - 0.95) <= half and failed == 0


def main() -> int:
    """Prints the shares; exit code 1 where one misses 95 % beyond its own interval."""
    numbers, names = ([a for a in sys.argv[1:] if a.isdigit() is is_it] for is_it in (True, False))
    seeds, good = int(numbers[0]) if numbers else 120, True
    with tempfile.TemporaryDirectory() as folder:
        for k, (name, model) in enumerate(kinds(Path(folder)).items()):
            if names and name not in names:
                continue
            with opened("mass", model=model) as twin:
                good &= proven(name, twin, range(1000 * k, 1000 * k + seeds))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
