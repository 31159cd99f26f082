"""The mobile robot docks at a moving carriage: `python -m proofs.docking [RUNS]`.

After Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital Twin": other
components co-simulate docking with the robot's twin, which may be off by 2 cm. The robot's process
writes recordings (3 s standing, 100 s sweep, 300 s of random commands); `Twin.run` follows each.
Then a docking 2 m ahead is planned in a co-simulation with a carriage that moves the dock away at
2 cm/s and stands still once the robot is within 50 cm; once on the model as configured and once on
the last champion. The robot's true drive gets the planned commands. Counted: position error at the
end, how often it stays within 2 cm, how often within the 95 % that the twin said. The dummy is the
model as configured. Asked: the champion's median within 2 cm, and within what it said in 95 %.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.ahead.docking import Docking, dock
from evertwin.ahead.spec import DockSpec
from evertwin.config import read, spec
from evertwin.errors import UsageError
from evertwin.worlds.drive import WORLDS, positions
from proofs._verdict import chance, ended, holds

TWIN = Path(__file__).parent.parent / "twins" / "robot1d.toml"


def recordings(folder: Path, world: str, runs: int) -> list[str]:
    """Written by the robot's process."""
    command = [
        sys.executable, "-m", "evertwin.worlds.robot", "--light", "--world", world, "--runs",
        str(runs), "--seconds", "300", "--format", "csv", "--out", str(folder / world),
    ]  # fmt: skip
    subprocess.run(command, check=True)
    return [str(path) for path in sorted((folder / world).glob("*.csv"))]


def true_error(world: str, docking: Docking, u: float, x: float, seed: int) -> float:
    """Where the true drive ends under the planned commands, against the dock [m]."""
    rng = np.random.default_rng([7, seed])
    told = np.r_[100.0 * u, 100.0 * docking.commands[:, 0]]
    way, _ = positions(rng, WORLDS[world][0], told)
    return abs(x + (way[-1] - way[1]) / 100.0 - float(docking.target[-1, 0]))


def one_run(world: str, name: str, seed: int) -> list[tuple[float, float, bool]]:
    """(true error, error that the twin said with 95 %, planned?) for both versions."""
    twin, carriage = Twin(read(TWIN)), Twin(TwinSpec("carriage", spec.ModelSpec("robot1d")))
    twin.run([name])
    last = twin.blocks([name])[-1]
    here = float(last.y[-1, 0])
    rule = DockSpec(
        machine="carriage.toml", output="x", dock=(here + 2.0, 0.0, 0.0), speed=0.2, step=1.0,
        command={"v": 0.02}, near=0.5,
    )  # fmt: skip
    other = carriage.prospect().basis
    found = []
    for number in (0, twin.champion.number):
        basis = replace(twin.prospect().basis, champion=number)
        try:
            docking = dock(basis, other, rule, [name])
        except UsageError:
            found.append((np.inf, np.inf, False))
            continue
        error = true_error(world, docking, float(last.u[-1, 0]), here, seed)
        found.append((error, docking.error95, True))
    return found


def main() -> int:
    """Prints the counts; exit code 1 unless the champion docks as said, within the tolerance."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    demands: dict[str, bool] = {}
    with tempfile.TemporaryDirectory() as folder:
        for world in WORLDS:
            files = recordings(Path(folder), world, runs)
            both = np.array([one_run(world, name, k) for k, name in enumerate(files)])
            for k, label in enumerate(("as configured", "last champion")):
                error, said, planned = both[:, k].T
                within, kept = int((error <= 0.02).sum()), int((error <= said).sum())
                print(
                    f"{world} {label:14} position error median {100 * np.median(error):5.2f} cm, "
                    f"90 % below {100 * np.quantile(error, 0.9):5.2f} cm, within 2 cm in {within} "
                    f"of {runs}, within the 95 % that was said in {kept}, planned "
                    f"{int(planned.sum())}"
                )
            error, said, _ = both[:, 1].T
            kept = float(np.mean(error <= said))
            demands[f"{world}: median within 2 cm"] = bool(np.median(error) <= 0.02)
            demands[f"{world}: within what was said"] = holds(0.95, kept, chance(0.95, runs))
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
