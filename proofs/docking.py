"""The mobile robot docks at a moving carriage: `python -m proofs.docking [RUNS [WORLD ...]]`.

After Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital Twin": other
components co-simulate docking with the robot's twin, which may be off by 2 cm. The robot's process
writes recordings (3 s standing, 100 s sweep, 300 s of random commands); `Twin.run` follows each
with `twins/robot1d.toml`. Then, by `Twin.whatif`, a docking 2 m ahead is planned in a co-simulation
with a carriage that moves the dock away at 2 cm/s and stands still once the robot is within 50 cm;
by a twin as configured and by one that ran. The robot's true drive gets the planned commands.
Counted: position error at the end and time, medians with their 95 % intervals; how often it stays
within 2 cm, how often within the 95 % that the twin said. The dummy is the model as configured.
Asked: the champion's median within 2 cm, and within what it said in 95 %.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.ahead.spec import DockSpec, ScenarioSpec
from evertwin.errors import UsageError
from evertwin.worlds.drive import WORLDS, positions
from planted.robots import recordings
from planted.twins import TWINS, opened
from proofs._verdict import chance, ended, holds


def true_error(world: str, docking: Mapping[str, Any], u: float, x: float, seed: int) -> float:
    """Where the true drive ends under the planned commands, against the dock [m]."""
    rng = np.random.default_rng([7, seed])
    told = np.r_[100.0 * u, 100.0 * np.array(docking["commands"])[:, 0]]
    way, _ = positions(rng, WORLDS[world][0], told)
    return abs(x + (way[-1] - way[1]) / 100.0 - float(docking["dock"][0]))


def median(values: np.ndarray) -> tuple[float, float, float]:
    """The median, and its 95 % interval by order (it knows no distribution)."""
    known, n = np.sort(values), len(values)
    reach = 0.98 * np.sqrt(n)
    ends = int(max(0.5 * n - reach, 0)), int(min(0.5 * n + reach, n - 1))
    return float(np.median(known)), float(known[ends[0]]), float(known[ends[1]])


def one_run(world: str, name: str, seed: int) -> list[tuple[float, float, float]]:
    """(true error, error that the twin said with 95 %, time) for both versions; infinity: not
    planned."""
    found = []
    for learns in (False, True):
        with opened("robot1d") as twin:
            if learns:
                twin.run(name)
            last = twin.blocks(name)[-1]
            here = float(last.y[-1, 0])
            rule = DockSpec(
                machine="robot1d.toml", output="x", dock=(here + 2.0, 0.0, 0.0), speed=0.2,
                step=1.0, command={"v": 0.02}, near=0.5,
            )  # fmt: skip
            scenario = ScenarioSpec("docking", docking=rule, folder=str(TWINS))
            try:
                docking: Any = twin.whatif(scenario, name).docking
            except UsageError:
                found.append((np.inf, np.inf, np.inf))
                continue
        error = true_error(world, docking, float(last.u[-1, 0]), here, seed)
        found.append((error, float(docking["error95"]), float(docking["seconds"])))
    return found


def main() -> int:
    """Prints the counts; exit code 1 unless the champion docks as said, within the tolerance."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    demands: dict[str, bool] = {}
    with tempfile.TemporaryDirectory() as folder:
        for world in sys.argv[2:] or WORLDS:
            files = recordings(Path(folder), world, runs, 300)
            both = np.array([one_run(world, name, k) for k, name in enumerate(files)])
            for k, label in enumerate(("as configured", "last champion")):
                error, said, seconds = both[:, k].T
                within, kept = int((error <= 0.02).sum()), int((error <= said).sum())
                middle, low, high = (100 * one for one in median(error))
                takes, least, most = median(seconds)
                print(
                    f"{world} {label:14} position error median {middle:.2f} cm ({low:.2f} … "
                    f"{high:.2f}), 90 % below {100 * np.quantile(error, 0.9):5.2f} cm, within 2 cm "
                    f"in {within} of {runs}, within the 95 % that was said in {kept}, planned "
                    f"{int(np.isfinite(seconds).sum())}, takes {takes:.0f} s ({least:.0f} … "
                    f"{most:.0f})",
                    flush=True,
                )
            error, said, _ = both[:, 1].T
            kept = float(np.mean(error <= said))
            demands[f"{world}: median within 2 cm"] = bool(np.median(error) <= 0.02)
            demands[f"{world}: within what was said"] = holds(0.95, kept, chance(0.95, runs))
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
