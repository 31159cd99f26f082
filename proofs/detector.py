"""Does the shipped detector find things in unseen worlds? `python -m proofs.detector`.

    python -m proofs.detector [HALLS [SEEDS]]

Halls, views, lenses, lamps and patterns are drawn by seeds that training had none of
(`proofs/detector_training`); each picture is of another hall. Scored is what
`evertwin.features.images.detector` gives, which `evertwin detect` calls: the average precision at
an overlap of half, over tables, boxes and people (the mean: mAP), of things at least 6 pixels wide
and high and of 40 pixels; beside it the net that saw as many pictures in one look, on the same
ones.

1. Looks drawn as in training. Asked: mAP ≥ .8, for each of the seeds.
2. Looks of families that training had none of (`planted.looks`): spot lights in colours, rings,
   dots, bricks, gradients. Asked: 10 points better than without randomisation.
3. The one look of the other net: what randomising costs there.
4. The embedded robot's own hall, which is no drawn one, from its camera, in five looks, through the
   command line: `evertwin machine robot --camera` and `evertwin detect`.
5. Time of a processor for one image: asked ≤ 50 ms in 95 % of the images. Size of the weights:
   asked < 2 MB.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from evertwin.features.images.detector import DATA, Detection, Detector
from evertwin.features.images.marks import Mark, average_precision
from evertwin.worlds.camera import Lens, Look, shaded, traced
from evertwin.worlds.looks import CLASSES, class_of, drawn, names, plain
from evertwin.worlds.scenes import hall, marked, view
from planted.looks import unlike
from proofs._verdict import ended

PLAIN = Path(__file__).parent / "detector_training" / "plain.onnx"
MAP, BETTER, MS, BYTES = 0.8, 0.10, 50.0, 2_000_000
LEAST = 0.02
Looks = Callable[[Any, float, np.random.Generator], Look]
Judged = tuple[list[Mark], list[Detection]]


def pictures(seed: int, halls: int, looks: Looks) -> list[tuple[np.ndarray, list[Mark]]]:
    """A picture of each of so many halls, and what it shows."""
    found = []
    for k in range(halls):
        rng = np.random.default_rng([9, seed, k])
        scene = hall(rng)
        model = mujoco.MjModel.from_xml_string(scene.xml)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        seen = traced(model, data, view(scene, rng), Lens(field=rng.uniform(1.1, 1.7)))
        pixels = shaded(model, data, seen, looks(model, scene.half, rng), rng)
        marks = [
            Mark(0, class_of(one.name) if one.clear else "", tuple(map(float, one.corners)))
            for one in marked(seen.geom, seen.range, names(model))
        ]
        found.append((pixels, marks))
    return found


def scores(detector: Detector, shown: list[tuple[np.ndarray, list[Mark]]]) -> dict[str, float]:
    """Average precision of each class, and of all (``mAP``)."""
    judged: list[Judged] = [(marks, detector.detect(pixels, LEAST)) for pixels, marks in shown]
    each = {label: average_precision(judged, label) for label in CLASSES}
    return each | {"mAP": float(np.mean(list(each.values())))}


def told(one: dict[str, float]) -> str:
    """In one line."""
    return ", ".join(f"{name} {value:.3f}" for name, value in one.items())


def both(name: str, halls: int, seeds: int, looks: Looks) -> tuple[np.ndarray, np.ndarray]:
    """mAP of each seed, with randomised training and without."""
    nets = Detector(), Detector(PLAIN)
    found = np.zeros((2, seeds))
    for seed in range(seeds):
        shown = pictures(seed, halls, looks)
        count = sum(bool(mark.label) for _, marks in shown for mark in marks)
        of = [scores(net, shown) for net in nets]
        found[:, seed] = [one["mAP"] for one in of]
        print(f"   {name}, seed {seed}, {halls} halls, {count} things: randomised {told(of[0])}; "
              f"not {told(of[1])}", flush=True)  # fmt: skip
    print(f"{name}: mAP randomised {found[0].mean():.3f} ({found[0].min():.3f} … "
          f"{found[0].max():.3f}), not {found[1].mean():.3f} ({found[1].min():.3f} … "
          f"{found[1].max():.3f})", flush=True)  # fmt: skip
    return found[0], found[1]


def plain_look(model: Any, half: float, _: np.random.Generator) -> Look:
    """The look of the other net."""
    return plain(model, half)


def embedded(seeds: int) -> dict[str, list[float]]:
    """Average precision in the robot's own hall, of each look, with both nets."""
    found: dict[str, list[float]] = {"randomised": [], "not": []}
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "run.mcap"
        for seed in range(1, seeds + 1):
            evertwin("machine", "robot", "--seed", seed, "--record", bag, "--seconds", 900,
                     "--camera", 0.2, "--order", "1:people=4")  # fmt: skip
            for name, weights in (("randomised", DATA), ("not", PLAIN)):
                said = evertwin("detect", bag, "--objects", bag.with_name("run-objects.csv"), "-o",
                                folder, "--weights", weights, "--json")  # fmt: skip
                each = json.loads(said)["average_precision"]
                found[name].append(float(np.mean(list(each.values()))))
                print(f"   embedded hall, look {seed}, {name}: {told(each)}", flush=True)
    return found


def evertwin(*words: object) -> str:
    """What a command says."""
    command = [sys.executable, "-m", "evertwin", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def times(halls: int) -> np.ndarray:
    """Of each image [ms of a processor]: what else runs there does not count."""
    detector, found = Detector(), []
    for pixels, _ in pictures(99, halls, drawn):
        start = time.process_time()
        detector.detect(pixels)
        found.append(1e3 * (time.process_time() - start))
    return np.array(found)


def main(halls: int = 500, seeds: int = 3) -> int:
    """Exit code 0 if everything asked was reached."""
    inside, _ = both("1. looks as in training", halls, seeds, drawn)
    wide, narrow = both("2. other lights and patterns", halls, seeds, unlike)
    both("3. the one look", halls, seeds, plain_look)
    for name, each in embedded(5).items():
        print(f"4. the embedded hall, {name}: mAP {np.mean(each):.3f} ({min(each):.3f} … "
              f"{max(each):.3f}) over {len(each)} looks", flush=True)  # fmt: skip
    took, size = times(200), DATA.stat().st_size
    print(f"5. one image: median {np.median(took):.1f} ms, 95 % below {np.quantile(took, 0.95):.1f}"
          f" ms of a processor; weights {size / 1e6:.2f} MB")  # fmt: skip
    return ended({
        f"mAP ≥ {MAP} in unseen worlds": bool(inside.min() >= MAP),
        "10 points better than without randomisation": bool((wide - narrow).min() >= BETTER),
        f"≤ {MS:g} ms": bool(np.quantile(took, 0.95) <= MS),
        "< 2 MB": size < BYTES,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])))
