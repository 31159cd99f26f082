"""Do simulated and real confusions differ? `python -m proofs.confusions [RUNS]`.

A detector of five classes, whose 20 confusions come at rates drawn by seed, labels simulated and
real things. In a run one confusion that is simulated at .05 is real at .15; files are written,
read and compared as `evertwin confusions` does. Counted over the runs, at the level 1 %:

1. 500 labels of each class and side: how often the difference is found, and that cell named; and
   other cells named beside it. Asked: found in 80 %.
2. The same without a difference: how often one is called. Asked: at most 1 %, as far as chance
   lets it be counted.
3. 500 labels of all classes together: power, as it is.
4. Images of scenes, 10 a scene, that are taken for the same in it, without a difference: with the
   scene as group, and without it, as it is. Asked with it: at most 1 %.
5. A setting that causes the confusion below its lower fifth, which the simulation does not draw:
   how often `randomise` names it.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin.features.images.confusions import confusions
from evertwin.features.images.labelled import read_labelled
from evertwin.features.images.randomisation import leads
from proofs._verdict import chance, ended

CLASSES = 5
LEVEL, POWER = 0.01, 0.8
FROM, TO = 0.05, 0.15


def rates(rng: np.random.Generator) -> np.ndarray:
    """Probability of each label for each truth, (k, k): the confusion 0 → 1 at `FROM`."""
    table = rng.uniform(0.0, 0.06, (CLASSES, CLASSES))
    table[0, 1] = FROM
    np.fill_diagonal(table, 0.0)
    np.fill_diagonal(table, 1.0 - table.sum(axis=1))
    return table


def labels(
    rng: np.random.Generator, table: np.ndarray, each: int, scene: int = 1
) -> list[tuple[str, str, str]]:
    """Rows (truth, label, group); in a scene of several rows half of them repeat the first."""
    rows = []
    for truth in range(CLASSES):
        own = rng.choice(CLASSES, (each // scene, scene), p=table[truth])
        same = (rng.random(own.shape) < 0.5) & (scene > 1)
        said = np.where(same, own[:, :1], own)
        rows += [
            (f"c{truth}", f"c{one}", f"{truth}-{k}") for k, of in enumerate(said) for one in of
        ]
    return rows


def written(file: Path, rows: list[tuple[str, str, str]], grouped: bool) -> Path:
    """A file as a detector's log may be."""
    head = "truth,label,group" if grouped else "truth,label"
    lines = (",".join(row[: 3 if grouped else 2]) for row in rows)
    file.write_text("\n".join([head, *lines, ""]))
    return file


def run(
    folder: Path, seed: int, each: int, to: float, scene: int = 1, grouped: bool = False
) -> tuple[bool, bool, bool]:
    """(called different, the planted cell named, another one named)."""
    rng = np.random.default_rng([13, seed])
    table = rates(rng)
    real = table.copy()
    real[0, :2] += (FROM - to, to - FROM)
    files = [
        written(folder / f"{name}.csv", labels(rng, one, each, scene), grouped)
        for name, one in (("simulated", table), ("real", real))
    ]
    found = confusions(read_labelled(files), LEVEL)
    named = {(cell.truth, cell.label) for cell in found.cells if cell.differs}
    planted = ("c0", "c1")
    return found.differ, planted in named, bool(named - {planted})


def cause(folder: Path, seed: int) -> bool:
    """Is the setting named that causes the confusion, and no other?"""
    rng = np.random.default_rng([14, seed])
    lines = ["truth,label,side,light,distance"]
    for side in ("simulated", "real"):
        for _ in range(1500):
            truth = rng.integers(3)
            light = rng.uniform(0.15 if side == "simulated" else 0.0, 1.0)
            wrong = rng.random() < (0.4 if truth == 0 and light < 0.2 else 0.02)
            row = (f"c{truth}", f"c{(truth + wrong) % 3}", side, light, rng.uniform(1, 4))
            lines.append(",".join(str(cell) for cell in row))
    (folder / "both.csv").write_text("\n".join([*lines, ""]))
    rows = read_labelled([folder / "both.csv"])
    cells = tuple(cell for cell in confusions(rows, LEVEL).cells if cell.differs)
    return [[lead.setting for lead in one] for one in leads(rows, cells, LEVEL)] == [["light"]]


def main() -> int:
    """Prints the counts; exit code 1 where one asked for is missed."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    cases = {
        "500 labels of each class, .05 → .15": (500, TO, 1, False),
        "500 labels of each class, no difference": (500, FROM, 1, False),
        "500 labels of all classes together, .05 → .15": (100, TO, 1, False),
        "500 of each class in scenes of 10, no difference, group": (500, FROM, 10, True),
        "500 of each class in scenes of 10, no difference, no group": (500, FROM, 10, False),
        "500 of each class in scenes of 10, .05 → .15, group": (500, TO, 10, True),
    }
    counted = {}
    with tempfile.TemporaryDirectory() as out:
        for name, case in cases.items():
            found = np.array([run(Path(out), seed, *case) for seed in range(runs)])
            counted[name] = called, _, _ = found.mean(axis=0)
            off = chance(max(called, 1 / runs), runs)
            print(
                f"{name:60} called different {called:.3f} ± {off:.3f}, that cell "
                f"named {found[:, 1].mean():.3f}, another {found[:, 2].mean():.3f}, {runs} runs",
                flush=True,
            )
        causes = np.mean([cause(Path(out), seed) for seed in range(runs // 5)])
    print(f"the setting that causes it named alone: {causes:.3f} of {runs // 5} runs")
    power = counted["500 labels of each class, .05 → .15"][1]
    most = LEVEL + chance(LEVEL, runs)
    nothing = [name for name in cases if "no difference" in name and "no group" not in name]
    return ended({
        f"power {POWER} at level {LEVEL}": bool(power >= POWER),
        **{f"called in at most {100 * LEVEL:g} %: {name}": bool(counted[name][0] <= most)
           for name in nothing},
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
