"""Streams a long recording through a source and prints peak memory and rate.

    python benchmarks/stream.py --hours 24 --format parquet

Writes a recording of 18 channels at 1 kHz (quantised sines, as an encoder gives them) into a
temporary folder piece by piece, then reads it in a process of its own and prints one JSON line:
rows, seconds, rows per second, and the peak resident memory of the reading process in MB, beside
what importing alone takes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evertwin.sources import Cell, Clock, Recorded

CHANNELS = 18
PIECE = 120_000


def pieces(rows: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Stamps [ns] and values, two minutes at a time."""
    frequency = 0.05 + 0.01 * np.arange(CHANNELS)
    for start in range(0, rows, PIECE):
        i = np.arange(start, min(start + PIECE, rows))
        v = np.round(np.sin(2 * np.pi * np.outer(i * 1e-3, frequency)), 3)
        yield i * 1_000_000, v


def write_parquet(path: Path, rows: int) -> None:
    """One file with a row group per two minutes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = ["t_ns", *(f"c{j}" for j in range(CHANNELS))]
    schema = pa.schema([(n, pa.int64() if n == "t_ns" else pa.float64()) for n in names])
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for t, v in pieces(rows):
            columns = [pa.array(t), *(pa.array(v[:, j]) for j in range(CHANNELS))]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))


def write_csv(path: Path, rows: int) -> None:
    """One text file."""
    with path.open("w", encoding="ascii") as file:
        file.write(",".join(["t_ms", *(f"c{j}" for j in range(CHANNELS))]) + "\n")
        for t, v in pieces(rows):
            table = np.column_stack([t // 1_000_000, v])
            np.savetxt(file, table, fmt=["%d", *["%.3f"] * CHANNELS], delimiter=",")


def peak_mb() -> int:
    """Peak resident memory of this process alone [MB] (getrusage would count its parent's)."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return round(int(status.split("VmHWM:")[1].split()[0]) / 1024)


def read(path: Path) -> dict[str, float]:
    """Stream the file once; every value is looked at."""
    before = peak_mb()
    cells = tuple(Cell(f"c{j}", f"c{j}", "1") for j in range(CHANNELS))
    source = Recorded("arm", (path,), cells, Clock(0))
    start, rows, total = time.perf_counter(), 0, 0.0
    for chunk in source.read():
        rows += len(chunk.t)
        total += float(chunk.v.sum())
    seconds = time.perf_counter() - start
    return {
        "rows": rows, "seconds": round(seconds, 1), "rows_per_second": round(rows / seconds),
        "peak_mb": peak_mb(), "import_mb": before, "sum": total,
    }  # fmt: skip


def main() -> None:
    """Write, then read in another process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--format", choices=["parquet", "csv"], default="parquet")
    parser.add_argument("--read", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.read is not None:
        print(json.dumps(read(chosen.read)))
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"run.{chosen.format}"
        rows = round(chosen.hours * 3600 * 1000)
        (write_parquet if chosen.format == "parquet" else write_csv)(path, rows)
        print(f"{path.stat().st_size / 1e6:.0f} MB on disk", file=sys.stderr)
        subprocess.run([sys.executable, __file__, "--read", str(path)], check=True)


if __name__ == "__main__":
    main()
