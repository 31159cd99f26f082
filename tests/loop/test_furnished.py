"""A twin among tables that its scans show: recorded, pushed, cut off and gone on; its stops."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import read
from evertwin.config.spec import StoreSpec
from evertwin.errors import ConfigError
from evertwin.fold import Chunk
from evertwin.outcome.result import RunResult
from evertwin.rows import Feed
from planted.furnished import Drive, driven, written
from planted.halls import from_start

SEED = 6


@pytest.fixture(scope="module")
def drive() -> Drive:
    """Rounds past a table that is moved, and straight at it."""
    return driven(SEED, tables=1, beams=360, rate=2.5, laps=1.75)


@pytest.fixture(scope="module")
def folder(drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("hall")
    written(drive, here, tables=2)
    return here


@pytest.fixture(scope="module")
def spec(folder: Path) -> TwinSpec:
    return read(folder / "cart.toml")


@pytest.fixture(scope="module")
def files(folder: Path) -> list[Path]:
    return [folder / "run-command.csv", folder / "run-scan.csv"]


@pytest.fixture(scope="module")
def chunks(spec: TwinSpec, files: list[Path]) -> list[Chunk]:
    with Twin(spec) as twin:
        return list(Feed(spec, twin.model).chunks(files))


@pytest.fixture(scope="module")
def result(spec: TwinSpec, files: list[Path]) -> RunResult:
    with Twin(spec) as twin:
        return twin.run(files)


def test_the_twin_stops_at_the_table_where_the_machine_does(
    drive: Drive, result: RunResult
) -> None:
    model, trace, push = result.model, result.trace, drive.pushes[-1]
    assert push.first > drive.when, "the table stands elsewhere than at first"
    p, rows = model.parameters.values, slice(push.first + 1, push.last + 1)
    x = model.observe(model.initial(p), trace["measured"][push.first])
    u, dt = trace["input"][rows].copy(), 1e-9 * np.diff(trace["t"][push.first : push.last + 1])
    end = from_start(drive.pose, drive.pose)[push.last, :2]
    assert np.hypot(*(model.simulate(x, u, dt, p)[1][-1, :2] - end)) < 0.03
    u[:, 2:] = 0.0
    assert np.hypot(*(model.simulate(x, u, dt, p)[1][-1, :2] - end)) > 0.3
    assert "suspected" not in [event.kind for event in result.events]


def test_a_plan_that_drives_at_the_table_ends_there(
    spec: TwinSpec, drive: Drive, folder: Path
) -> None:
    """The plan says speeds alone: where tables stand the scans have said."""
    push, short = drive.pushes[-1], folder / "short"
    written(drive.until(push.first), short, tables=2)
    rows = "".join(f"{0.4 * k:.1f},0.3,0\n" for k in range(30))
    (folder / "plan.csv").write_text(f"t,v,w\n{rows}")
    with Twin(spec) as twin:
        recorded = [short / "run-command.csv", short / "run-scan.csv"]
        seen = twin.forecast(12.0, recorded, inputs=folder / "plan.csv")
    end = from_start(drive.pose, drive.pose)[push.last, :2]
    told = np.array([seen.outputs[name].value[-1] for name in ("x.pos", "y.pos")])
    assert np.hypot(*(told - end)) < 0.03


def test_a_moved_table_is_named_and_the_rows_have_it(drive: Drive, result: RunResult) -> None:
    kinds = [event.kind for event in result.events]
    assert [one for one in kinds if one.startswith("table")] == [
        "table_found", "table_appeared", "table_moved",
    ]  # fmt: skip
    [moved] = [event for event in result.events if event.kind == "table_moved"]
    after = from_start(drive.pose, drive.after)[drive.moved, :2]
    tables = result.trace["input"][:, 2:].reshape(-1, 2, 6)
    then = int(np.searchsorted(result.trace["t"], moved.time, side="right"))
    assert np.hypot(*(tables[then, 0, :2] - after)) < 0.05
    assert np.hypot(*(tables[drive.when - 1, 0, :2] - after)) > 0.5
    assert not tables[0].any() and not tables[-1, 1].any()
    assert "was moved by" in str(result)


def test_pushed_is_recorded_also_where_the_twin_is_cut_off_and_goes_on(
    spec: TwinSpec, chunks: list[Chunk], result: RunResult, tmp_path: Path
) -> None:
    spec = replace(spec, store=StoreSpec("twin.db"), folder=str(tmp_path),
                   model=replace(spec.model, options={
                       **spec.model.options, "file": f"{spec.folder}/cart.xml"}))  # fmt: skip
    rests, falls = len(chunks) // 2, (len(chunks) // 2 + 9, 3 * len(chunks) // 4)
    twin = Twin(spec)
    for k, chunk in enumerate(chunks):
        if k == rests:
            twin.going().rest()  # a checkpoint; what follows is folded again
        if k in falls:
            twin.close()
            twin = Twin(spec)
        twin.push(chunk)
    again = twin.finish()
    twin.close()
    n = len(again.trace["measured"])
    assert n > 15, "the rows since it went on"
    for name in ("input", "measured", "predicted", "t"):
        assert np.array_equal(again.trace[name], result.trace[name][-n:], equal_nan=True)
    told = [(event.row, event.kind, event.reason) for event in again.events]
    assert told == [(event.row, event.kind, event.reason) for event in result.events]


def test_a_model_with_more_places_than_the_scans_fill_is_refused(
    spec: TwinSpec, files: list[Path]
) -> None:
    assert spec.perception is not None
    fewer = replace(spec, perception=replace(spec.perception, tables=1))
    with Twin(fewer) as twin, pytest.raises(ConfigError, match=r"table2\.x"):
        twin.run(files)
