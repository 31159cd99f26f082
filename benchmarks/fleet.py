"""What a shared store costs: `python -m benchmarks.fleet [ROWS]`.

The same rows go one by one through the same twin (`twins/robot1d.toml`), once on its SQLite file
and once on a PostgreSQL server under a token, in turns of a hundred: the time until a sample is
durable, and until what the twin says of it is durable too. Both folders lie on the same disk.
"""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from evertwin import Twin
from evertwin.config import read
from evertwin.fold import Chunk
from evertwin.store import SharedStore, SqliteStore, SqlOwners, Store
from evertwin.store.postgres.database import Postgres
from evertwin.store.spec import StoreSpec
from planted.postgres import Server

FILE = Path(__file__).parent.parent / "twins" / "robot1d.toml"
TURN = 100


def chunks(rows: int) -> list[Chunk]:
    """A cart that drives 10 % too fast."""
    rng = np.random.default_rng(1)
    v = np.repeat(rng.uniform(0.05, 0.2, rows // 10 + 1), 10)[:rows]
    x = np.r_[0.0, np.cumsum(1.1 * v[:-1])] + rng.normal(0.0, 0.002, rows)
    return [
        Chunk("log", np.array([k * 10**9]), np.array([[v[k], x[k]]])) for k in range(rows)
    ]  # fmt: skip


def timed(twin: Twin, chunk: Chunk) -> tuple[float, float]:
    """Seconds until a sample is durable, and until its verdict is."""
    begun = time.perf_counter()
    kept = twin.going().keep(chunk)
    twin.store.flush()
    durable = time.perf_counter() - begun
    twin.going().fold(kept)
    twin.going().settle()
    twin.store.flush()
    return durable, time.perf_counter() - begun


def main(rows: int = 2000) -> None:
    """Prints the figures."""
    with tempfile.TemporaryDirectory() as folder, Server() as server:
        with closing(Postgres(server.address)) as database:
            token = SqlOwners(database).claim("cart", "here", 600.0)
        stores: dict[str, Store] = {
            "file": SqliteStore(Path(folder) / "cart.db"),
            "server": SharedStore(server.address, "cart", token),
        }
        spec = replace(read(FILE), name="cart", store=StoreSpec())
        twins = {name: Twin(spec, store=store) for name, store in stores.items()}
        took: dict[str, list[tuple[float, float]]] = {name: [] for name in twins}
        every = chunks(rows)
        for begin in range(0, rows, TURN):
            for name, twin in twins.items():
                took[name] += [timed(twin, one) for one in every[begin : begin + TURN]]
        for twin in twins.values():
            twin.close()
    found = {name: 1e3 * np.array(one) for name, one in took.items()}
    for k, what in enumerate(("durable", "verdict durable")):
        told = {name: np.quantile(one[:, k], (0.5, 0.99)) for name, one in found.items()}
        ratio = told["server"] / told["file"]
        print(f"{what:16} " + "  ".join(
            f"{name}: p50 {low:.2f} ms, p99 {high:.2f} ms" for name, (low, high) in told.items()
        ) + f"  server / file: {ratio[0]:.1f}, {ratio[1]:.1f}")  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
