"""Trains the detector: `python -m proofs.detector_training`.

    pip install -r proofs/detector_training/requirements.txt    # beside evertwin[mujoco]
    python -m proofs.detector_training

Two nets of one form, on as many pictures, for as many steps: one on randomised looks, one on the
plain look. The first goes to ``src/evertwin/features/images/data/objects.onnx``, which the package
ships; the second to this folder, for `proofs.detector` to compare. One core, about twenty minutes.
"""

from __future__ import annotations

import argparse
import sys
import time
from multiprocessing import Pool
from pathlib import Path

import numpy as np
import onnx
import torch

from evertwin.worlds.looks import CLASSES
from proofs.detector_training.net import Net, loss
from proofs.detector_training.pictures import LENS, pictures

HERE = Path(__file__).parent
SHIPPED = HERE.parents[1] / "src" / "evertwin" / "features" / "data" / "objects.onnx"
BATCH, RATE = 16, 3e-3


def rendered(halls: int, randomised: bool, workers: int) -> list[torch.Tensor]:
    """Pixels, heat and boxes of two views into each of so many halls."""
    with Pool(workers) as pool:
        jobs = ((seed, randomised) for seed in range(halls))
        several = pool.starmap(pictures, jobs, chunksize=50)
    every = [one for two in several for one in two]
    return [torch.from_numpy(np.stack(part)) for part in zip(*every, strict=True)]


def batch(data: list[torch.Tensor], rows: np.ndarray, mirrored: bool) -> list[torch.Tensor]:
    """Rows of the data, as they are or left for right."""
    pixels, heat, box = (part[torch.from_numpy(rows)].float() for part in data)
    pixels = pixels.permute(0, 3, 1, 2)
    if mirrored:
        pixels, heat, box = (part.flip(-1) for part in (pixels, heat, box))
        box = box[:, :, [2, 1, 0, 3]]
    return [pixels.contiguous(), heat, box]


def trained(data: list[torch.Tensor], epochs: int) -> Net:
    """A net that learned from the data, the learning rate up and down in one cycle."""
    torch.manual_seed(1)
    rng = np.random.default_rng(1)
    short = torch.cpu._is_avx512_bf16_supported()  # half the time where the processor has it
    net = Net(len(CLASSES)).to(memory_format=torch.channels_last)
    count = len(data[0]) // BATCH
    optimiser = torch.optim.AdamW(net.parameters(), RATE, weight_decay=0.02)
    cycle = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, epochs * count, pct_start=0.15)
    for epoch in range(epochs):
        total, start = 0.0, time.monotonic()
        for rows in rng.permutation(len(data[0]))[: count * BATCH].reshape(-1, BATCH):
            pixels, heat, box = batch(data, rows, bool(rng.integers(2)))
            pixels = pixels.to(memory_format=torch.channels_last)
            with torch.autocast("cpu", torch.bfloat16, enabled=short):
                logits, edges = net.raw(pixels)
            one = loss(logits.float(), edges.float(), heat, box)
            optimiser.zero_grad()
            one.backward()
            torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
            optimiser.step()
            cycle.step()
            total += float(one.detach())
        print(f"  epoch {epoch + 1}/{epochs}: loss {total / count:.3f}, "
              f"{time.monotonic() - start:.0f} s", flush=True)  # fmt: skip
    return net.eval()


def shipped(net: Net, file: Path) -> None:
    """Writes a net."""
    file.parent.mkdir(parents=True, exist_ok=True)
    example = torch.zeros(1, 3, LENS.height, LENS.width)
    torch.onnx.export(net.to(memory_format=torch.contiguous_format), (example,), str(file),
                      input_names=["picture"], output_names=["cells"], dynamo=False)  # fmt: skip
    model = onnx.load(file)
    onnx.helper.set_model_props(model, {"classes": ",".join(CLASSES)})
    onnx.save(model, file)
    print(f"{file}: {file.stat().st_size} bytes", flush=True)


def main() -> int:
    """Trains both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--halls", type=int, default=6000)
    parser.add_argument("--epochs", type=int, default=12)
    parser.add_argument("--workers", type=int, default=1, help="processes that render")
    given = parser.parse_args()
    torch.set_num_threads(1)
    for randomised, file in ((True, SHIPPED), (False, HERE / "plain.onnx")):
        start = time.monotonic()
        data = rendered(given.halls, randomised, given.workers)
        print(f"{'randomised' if randomised else 'plain'}: {len(data[0])} pictures in "
              f"{time.monotonic() - start:.0f} s", flush=True)  # fmt: skip
        shipped(trained(data, given.epochs), file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
