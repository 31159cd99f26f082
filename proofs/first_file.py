"""What does a first twin file tell of a machine? `python -m proofs.first_file [SEEDS] [FIRST]`.

Ovens and winches drawn by seed (`planted.stores`), of each a healthy one and one that changes at
row 60 % of its recording: an oven loses 0.7 or 1.35 times the heat, a winch goes 0.75 to 1.2 times
as far. `evertwin init` writes the file, nobody edits it, `evertwin run` runs it. Asked:

    told      a suspicion, within a twentieth of the recording, in 90 %
    named     the row of the change, within a hundredth of the recording, in 80 % of those
    learned   a version that is promoted behind it, in 80 %
    healthy   no suspicion after the middle of the recording, in 90 %
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from planted.stores import Machine, oven, record, winch
from proofs._verdict import ended

EVERTWIN = [sys.executable, "-m", "evertwin"]


class Found(NamedTuple):
    """Of one machine."""

    told: float
    """Rows from the change to the suspicion, as a share of the recording; infinite: none."""
    named: bool
    learned: bool
    seconds: float


def looked(machine: Machine, folder: Path) -> Found:
    """By the command, as whoever has nothing but a recording goes."""
    record(machine, folder / "run.csv")
    began = time.monotonic()
    for words in (["init", "run.csv", "-o", "new.toml", "--force"], ["run", "new.toml", "--json"]):
        done = subprocess.run([*EVERTWIN, *words], cwd=folder, capture_output=True, text=True,
                              check=True)  # fmt: skip
    events: list[Any] = json.loads(done.stdout)["events"]
    rows = len(machine.columns)
    behind = [one for one in events if one["row"] >= machine.changed]
    first = next((one["row"] for one in behind if one["kind"] in ("suspected", "drift")), None)
    told = float("inf") if first is None else (first - machine.changed) / rows
    names = [re.search(r"changed at row (\d+)", one["reason"]) for one in behind]
    named = any(abs(int(one[1]) - machine.changed) <= 0.01 * rows for one in names if one)
    learned = any(one["kind"] == "promoted" for one in behind)
    return Found(told, named, learned, time.monotonic() - began)


def main(seeds: int = 10, first: int = 0) -> int:
    """Exit code 0 where everything asked is reached."""
    demands = dict[str, bool]()
    for name, drawn in (("ovens", oven), ("winches", winch)):
        changed, healthy = list[Found](), list[Found]()
        for seed in range(first, first + seeds):
            with tempfile.TemporaryDirectory() as folder:
                changed.append(looked(drawn(seed), Path(folder)))
                healthy.append(looked(drawn(seed, healthy=True), Path(folder)))
        told = [one for one in changed if one.told <= 0.05]
        shares = {
            "told": (len(told), seeds, 0.9),
            "named": (sum(one.named for one in told), len(told), 0.8),
            "learned": (sum(one.learned for one in changed), seeds, 0.8),
            "healthy": (sum(one.told == float("inf") for one in healthy), seeds, 0.9),
        }
        late = sorted(one.told for one in told)
        seconds = sorted(one.seconds for one in changed + healthy)
        said = ", ".join(f"{key} {n} of {of}" for key, (n, of, _) in shares.items())
        middle = 100 * late[len(late) // 2] if late else float("nan")
        sys.stdout.write(
            f"{name}: {said}; told after {middle:.1f} % of the recording (median); init and run "
            f"{seconds[len(seconds) // 2]:.0f} s (median), {seconds[-1]:.0f} at most\n"
        )
        sys.stdout.flush()
        demands |= {f"{name}: {key}": n >= least * of for key, (n, of, least) in shares.items()}
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:3])))
