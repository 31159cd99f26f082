"""FMUs that break down: the twin's process goes on, the row is lost, and nothing else."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.errors import ModelError
from evertwin.models import Restart, roll
from evertwin.models.corrected.corrected import Corrected, Term
from evertwin.models.fmu import Fmu, fmu

from .native import build

FAST = {"row_seconds": 0.3, "memory_mb": 400.0}
# the other ways to misbehave are in proofs/bad_files.py
LOST = {
    "segfault": ("crashed", "SIGSEGV"),
    "malloc": ("crashed", "SIGSEGV"),
    "exit": ("exited", "exit code 0"),
    "loop": ("hung", "0.3 s"),
    "fatal": ("fatal", "Fatal"),
    "discard": ("failed", "1 of 100 rows ended with fmi Discard"),
    "nan": ("failed", "not finite"),
}
Broken = Callable[..., Fmu]


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broken]:
    """An FMU that misbehaves in one way."""
    folder = tmp_path_factory.mktemp("broken")
    models: list[Fmu] = []

    def of(bad: str, **options: Any) -> Fmu:
        file = build(folder / f"{bad}{len(models)}", bad=bad, three=bad in ("segfault", "fatal"))
        models.append(fmu(file, **{**FAST, **options}))
        return models[-1]

    yield of
    for model in models:
        model.close()


def rows(*trips: int) -> tuple[np.ndarray, np.ndarray]:
    u = 4.0 * np.sin(0.02 * np.arange(100.0))[:, None]
    u[list(trips)] = 1000.0
    return u, np.full(100, 0.01)


@pytest.mark.parametrize("bad", list(LOST))
def test_one_row_is_lost(broken: Broken, bad: str) -> None:
    model = broken(bad)
    p = model.parameters.values
    x = model.initial(p)
    u, dt = rows(40)
    _, y = model.simulate(x, u, dt, p)
    lost = np.isnan(y).any(axis=1)
    assert np.flatnonzero(lost).tolist() == [40]
    kind, detail = LOST[bad]
    (fault,) = model.faults
    assert (fault.kind, fault.row) == (kind, 40) and detail in fault.detail
    assert fault.seconds < 1.0
    calm = np.delete(u, 40, axis=0)
    _, without = model.simulate(x, calm, dt[1:], p)
    assert np.abs(np.delete(y, 40, axis=0) - without).max() < 1e-12, "it goes on from its state"
    assert len(model.faults) == 1


def test_a_row_is_lost_in_model_exchange_too(broken: Broken) -> None:
    model = broken("segfault", interface="model-exchange")
    u, dt = rows(40)
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, dt, p)
    assert np.flatnonzero(np.isnan(y).any(axis=1)).tolist() == [40]


def test_it_is_given_up_in_bounded_time(broken: Broken) -> None:
    """Every row crashes: the call ends, with every row failed, and so do all later ones."""
    model = broken("segfault", faults=4)
    wrapped = Corrected(model, (Term("law", "force"),))
    p = wrapped.parameters.values
    u, dt = rows(*range(100))
    began = time.perf_counter()
    _, y = wrapped.simulate(wrapped.initial(p), u, dt, p)
    _, again = wrapped.simulate(wrapped.initial(p), *rows(), p)
    assert time.perf_counter() - began < 30.0
    assert np.isnan(y).all() and np.isnan(again).all()
    assert not model.worker.alive and len(model.faults) == 4
    news = model.worker.news()
    assert "given up" in news[-1] and model.worker.news() == ()


def test_a_crash_while_loading_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"mass\.fmu: .*SIGSEGV"):
        fmu(build(tmp_path, bad="load"), **FAST)


def test_nothing_is_left_behind(tmp_path: Path) -> None:
    before = set(os.listdir("/proc/self/fd"))
    model = fmu(build(tmp_path, bad="segfault"), **FAST)
    assert model.worker._process is not None and model.worker._folder is not None
    process, folder = model.worker._process._process, model.worker._folder
    assert folder.is_dir()
    inherited = os.listdir(f"/proc/{process.pid}/fd")
    assert len(inherited) <= 8, "no files of this process but the three of the talk"
    with open(f"/proc/{process.pid}/environ", "rb") as file:
        names = {entry.split(b"=")[0] for entry in file.read().split(b"\0") if entry}
    assert names <= {b"PATH", b"HOME", b"LANG", b"LC_ALL", b"LD_LIBRARY_PATH", b"PYTHONPATH",
                     b"NUMBA_CACHE_DIR", b"COVERAGE_PROCESS_CONFIG"}  # fmt: skip
    u, dt = rows(3)
    p = model.parameters.values
    model.simulate(model.initial(p), u, dt, p)
    model.close()
    assert process.poll() is not None and not folder.exists()
    assert set(os.listdir("/proc/self/fd")) == before


def test_inputs_that_are_not_finite_never_reach_it(broken: Broken) -> None:
    model = broken("nan")
    u, dt = rows()
    u[10], dt[20], dt[30] = np.nan, -1.0, np.inf
    p = model.parameters.values
    _, y = roll(model.kernel(), model.initial(p), u, dt, p, Restart.never(100, 3))
    assert np.flatnonzero(np.isnan(y).any(axis=1)).tolist() == [10, 20, 30]
    assert model.faults == ()


def test_a_block_larger_than_the_shared_memory(broken: Broken) -> None:
    model = broken("exit")
    n = 60_000
    u, dt = np.full((n, 1), 0.1), np.full(n, 0.01)
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, dt, p)
    u[50_000] = 1000.0
    _, lost = model.simulate(model.initial(p), u, dt, p)
    assert np.isfinite(y).all() and np.isnan(lost).any(axis=1).sum() == 1
