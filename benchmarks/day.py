"""A day through the whole twin: `python -m benchmarks.day [--hours 1]`.

Writes recordings of a 6-axis arm at 1 kHz, an hour a file (q, its first and second derivative, six
torques: 24 channels), folds them through `Twin.run` in a process of its own and prints rows,
seconds, rows per second, and the peak resident memory of that process in MB, beside what it has
after its imports. One file serves for every hour, each a task of its own. `--hours 24` takes some
minutes.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.stream import peak_mb
from evertwin import Twin
from evertwin.config.spec import (
    ArbiterSpec,
    ChannelSpec,
    ModelSpec,
    MovingSpec,
    ParameterSpec,
    PredictionSpec,
    SourceSpec,
    Span,
    TimeSpec,
    TwinSpec,
)
from evertwin.setup.configured_model import model_of

HOUR = 3_600_000
PIECE = 60_000
LIMIT = 500
UNITS = {"q": "rad", "qd": "rad/s", "qdd": "rad/s^2", "tau": "Nm"}


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def spec(hours: int, folder: Path) -> TwinSpec:
    """An arm that is watched; its friction is as the file has it."""
    names = [(f"{kind}{k}", unit) for kind, unit in UNITS.items() for k in range(1, 7)]
    channels = {name: ChannelSpec(name, unit=unit) for name, unit in names}
    files = tuple(str(folder / f"{hour}.parquet") for hour in range(hours))
    source = SourceSpec("arm", channels, files, time=TimeSpec(column="t", unit="ns"))
    return TwinSpec(
        "arm", ModelSpec("arm", {"urdf": "ur5_like", "law": "tanh"},
                         {f"Fc{k}": ParameterSpec(value=5.0) for k in range(1, 7)}),
        source=(source,), beat=Span(1000), arbiter=ArbiterSpec(gate=12.0),
        prediction=PredictionSpec(horizon=1.0),
        moving=MovingSpec(channels={f"tau{k}": f"qd{k}" for k in range(1, 7)}, above=0.05),
    )  # fmt: skip


def write(path: Path, rows: int, hour: int) -> None:
    """The file of an hour, with a row group a minute, quantised as encoders are."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    twin, rng = spec(1, path.parent), np.random.default_rng(0)
    model = model_of(twin, None)
    names = ["t", *twin.source[0].channels]
    schema = pa.schema([(n, pa.int64() if n == "t" else pa.float64()) for n in names])
    w, a = rng.uniform(0.2, 0.7, 6), rng.uniform(0.3, 0.9, 6)
    rng = np.random.default_rng([hour, 1])
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for start in range(0, rows, PIECE):
            i = np.arange(start, min(start + PIECE, rows))
            angle = 1e-3 * i[:, None] * w
            parts = [a * np.sin(angle), a * w * np.cos(angle), -a * w**2 * np.sin(angle)]
            u = np.round(np.concatenate(parts, axis=1), 5)
            _, tau = model.simulate(np.zeros(0), u, np.zeros(len(u)), model.parameters.values)
            tau = np.round(tau + rng.normal(0.0, 0.5, tau.shape), 2)
            columns = [pa.array(i * 1_000_000), *map(pa.array, u.T), *map(pa.array, tau.T)]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))


def fold(path: Path, hours: int) -> None:
    """Prints the figures of one run."""
    imported = peak_mb()
    begin = time.perf_counter()
    result = Twin(spec(hours, path)).run()
    seconds = time.perf_counter() - begin
    peak = peak_mb()
    rms = max(one.relative_rms_after for one in result.outputs.values())
    rate = result.samples / seconds
    say(
        f"{result.samples} rows ({hours} h at 1 kHz, 24 channels) in {seconds:.1f} s: "
        f"{rate:.0f} rows/s, {rate / 1000:.0f} x real time"
    )
    say(
        f"peak {peak} MB ({imported} MB after import), limit {LIMIT} MB: {LIMIT / peak:.2f} x "
        f"below; {len(result.events)} events, largest deviation {100 * rms:.1f} %"
    )


def main() -> None:
    """Write, then fold in another process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=int, default=1)
    parser.add_argument("--rows", type=int, default=HOUR, help="rows of each file")
    parser.add_argument("--fold", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.fold is not None:
        fold(chosen.fold, chosen.hours)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        for hour in range(chosen.hours):
            write(path / f"{hour}.parquet", chosen.rows, hour)
        command = [sys.executable, "-m", "benchmarks.day", "--hours", str(chosen.hours)]
        subprocess.run([*command, "--fold", str(path)], check=True)


if __name__ == "__main__":
    main()
