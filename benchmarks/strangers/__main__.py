"""Draw, predict, score: `python -m benchmarks.strangers write|predict|score|table …`.

write known|late FOLDER SEEDS [FAMILY …]   the machines, as plain files
predict FOLDER                             SciPy's, a naive and evertwin's predictions
score FOLDER                               a line per machine
table known|late SEEDS [FAMILY …]          all of it in a folder of its own

SEEDS: so many from 0 on, or the first and the last (31-33).
"""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from benchmarks.strangers import draw, textbook, twin
from benchmarks.strangers.score import OWN, Score, score

METHODS = ("configured", "scipy", "fit", "run")


def write(group: str, folder: Path, seeds: str, families: list[str]) -> None:
    """The machines of a set as plain files."""
    first, between, last = seeds.partition("-")
    drawn = range(int(first), int(last) + 1) if between else range(int(first))
    for family in families or draw.names(group):
        for seed in drawn:
            draw.write(group, family, seed, folder)


def predict(place: Path) -> str:
    """Predictions of a machine by every method; what the running twin came to."""
    textbook.write(place)
    result = twin.run(place)
    last = [event.kind for event in result.of_kind("normal", "abnormal", "corrected")][-1:]
    said = "live" if result.of_kind("promoted") else "as configured"
    return f"{said}, form not known" if last == ["abnormal"] else said


def line(found: Score, outcome: str = "") -> None:
    """A machine's errors in those of its true form."""
    sizes = "".join(f"{found.ratio[m]:11.2f}" for m in METHODS if m in found.ratio)
    print(f"{found.machine:16}{sizes}  {outcome}", flush=True)


def summary(found: list[tuple[Score, str]]) -> None:
    """Per family: medians, the gap closed, how often worse than as configured."""
    families = defaultdict(list)
    for one, outcome in found:
        families[one.machine.rsplit("-", 1)[0]].append((one, outcome))
    print(f"{'family':16}" + "".join(f"{m:>11}" for m in METHODS) + "  gap closed by fit, run; "
          "worse; not live")  # fmt: skip
    for family, members in families.items():
        medians = "".join(f"{np.median([s.ratio[m] for s, _ in members]):11.2f}" for m in METHODS)
        closed = [np.median([s.closed(m) for s, _ in members]) for m in ("fit", "run")]
        worse = sum(s.ratio["run"] > 1.01 * s.ratio["configured"] for s, _ in members)
        still = sum("live" not in outcome for _, outcome in members)
        print(
            f"{family:16}{medians}  {100 * closed[0]:6.0f} % {100 * closed[1]:6.0f} %"
            f"{worse:8} {still:6} of {len(members)}"
        )


def table(group: str, seeds: str, families: list[str]) -> list[tuple[Score, str]]:
    """Every machine of a set, drawn, predicted and scored."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        write(group, Path(folder), seeds, families)
        print(f"{'machine':16}" + "".join(f"{m:>11}" for m in METHODS) + "  the running twin")
        for place in sorted(Path(folder).iterdir()):
            outcome = predict(place)
            found.append((score(place), outcome))
            line(*found[-1])
    summary(found)
    return found


def main(arguments: list[str]) -> int:
    """What the command line asks for."""
    match arguments:
        case ["write", group, folder, seeds, *families]:
            write(group, Path(folder), seeds, families)
        case ["predict", folder]:
            for place in sorted(Path(folder).iterdir()):
                print(f"{place.name:16} {predict(place)}", flush=True)
        case ["score", folder]:
            for place in sorted(Path(folder).iterdir()):
                found = score(place)
                print(place.name, {m: round(r, 3) for m, r in found.ratio.items() if m != OWN})
        case ["table", group, seeds, *families]:
            table(group, seeds, families)
        case _:
            print(__doc__)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
