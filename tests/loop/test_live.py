"""Samples that are pushed give the run that a recording of them gives."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import (
    AnomalySpec,
    ArraySpec,
    ChannelSpec,
    ModelSpec,
    PredictionSpec,
    SourceSpec,
    Span,
    StoreSpec,
    TuningSpec,
)
from evertwin.engine import EngineSpec, InProcess
from evertwin.errors import DataError, UsageError
from evertwin.fold import Answer, Chunk

SPEC = TwinSpec(
    "cart", ModelSpec("robot1d"), beat=Span(seconds=10.0), prediction=PredictionSpec(horizon=5.0),
    anomaly=AnomalySpec(requirement=0.02, relative=False, window=Span(seconds=60.0)),
    tuning=TuningSpec(window=Span(seconds=200.0)),
    source=(SourceSpec("log", {n: ChannelSpec(n, unit="1") for n in ("v", "x")}),),
)  # fmt: skip


def drive(n: int = 900) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    v = np.repeat(rng.uniform(0.0, 0.2, n // 10), 10)
    x = np.r_[0.0, np.cumsum(1.1 * v[:-1])] + rng.normal(0.0, 0.002, n)
    return {"t": np.arange(n) * 1.0, "v": v, "x": x}


def pieces(data: dict[str, np.ndarray], sizes: list[int]) -> list[dict[str, np.ndarray]]:
    cuts = np.cumsum(sizes * (len(data["t"]) // sum(sizes) + 1))
    edges = [0, *cuts[cuts < len(data["t"])].tolist(), len(data["t"])]
    return [{k: c[a:b] for k, c in data.items()} for a, b in pairwise(edges)]


def said(twin: Twin) -> list[tuple[int, str, str]]:
    return [(e.row, e.kind, e.reason) for e in twin.events if e.kind != "started"]


@pytest.mark.parametrize("sizes", [[1], [7, 200, 3]], ids=["one by one", "in pieces"])
def test_pushed_is_recorded(sizes: list[int]) -> None:
    data = drive()
    with Twin(SPEC) as recorded, Twin(SPEC) as live:
        expected = recorded.run(data)
        for piece in pieces(data, sizes):
            live.push(piece)
        view = live.view(50)
        result = live.finish()
        assert said(live) == said(recorded) and any(k == "promoted" for _, k, _ in said(live))
    assert result.champion == expected.champion and result.samples == expected.samples
    for name in ("measured", "predicted", "mark", "version"):
        np.testing.assert_array_equal(result.trace[name], expected.trace[name])
    assert view.row.tolist() == list(range(850, 900)) and view.version[-1] == 1


def test_a_twin_that_died_goes_on(tmp_path: Path) -> None:
    data, spec = drive(), SPEC.__class__(**{**SPEC.__dict__, "store": StoreSpec("twin.db")})
    spec = spec.__class__(**{**spec.__dict__, "folder": str(tmp_path)})
    with Twin(SPEC) as unbroken:
        for piece in pieces(data, [30]):
            unbroken.push(piece)
        unbroken.finish()
        expected = said(unbroken)
    parts = pieces(data, [30])
    for number, part in enumerate((parts[:5], parts[5:17], parts[17:])):
        with Twin(spec) as twin:
            for piece in part:
                twin.push(piece)
            if number == 2:
                twin.finish()
                assert said(twin) == expected


def test_a_twin_that_died_folds_what_came_after_its_checkpoint(
    spec: TwinSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evertwin.loop.run.SECONDS", 0.0)
    monkeypatch.setattr("evertwin.loop.run.SHARE", 0.0)
    data = pieces(drive(), [30])
    with Twin(SPEC) as unbroken:
        for piece in data:
            unbroken.push(piece)
        expected = unbroken.finish(), said(unbroken)
    began = []
    for part in (data[:3], data[3:9], data[9:22], data[22:]):
        with Twin(spec) as twin:
            for piece in part:
                twin.push(piece)
            view = twin.view(10)
            if part[-1] is data[-1]:
                result = twin.finish()
                began.append(result.began)
                assert said(twin) == expected[1]
    assert began[0] >= 600  # not from the first row
    assert result.champion == expected[0].champion
    for name, column in expected[0].trace.items():
        np.testing.assert_array_equal(result.trace[name], column, err_msg=name)
    assert view.row.tolist() == list(range(890, 900))


def test_what_is_kept_waits_in_the_store_for_its_fold(
    spec: TwinSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evertwin.loop.run.SECONDS", 0.0)  # a checkpoint with every fold
    monkeypatch.setattr("evertwin.loop.run.SHARE", 0.0)
    with Twin(SPEC) as unbroken:
        unbroken.push(drive())
        expected, events = unbroken.finish(), said(unbroken)
    parts = [
        Chunk("log", np.rint(1e9 * one["t"]).astype(np.int64), np.stack([one["v"], one["x"]], 1))
        for one in pieces(drive(), [30])
    ]
    with Twin(spec) as twin:
        kept = [twin.going().keep(part) for part in parts]
        assert [one.number for one in kept] == list(range(1, 31))
        for one in kept[:13]:
            twin.going().fold(one)
        assert len(twin.view(10**6).row) == 390
    with Twin(spec) as twin:  # its checkpoints are of what was folded, not of what was kept
        assert len(twin.going().view(10**6).row) == 900
        result = twin.finish()
        assert said(twin) == events and result.champion == expected.champion
    for name, column in expected.trace.items():
        np.testing.assert_array_equal(result.trace[name], column, err_msg=name)


def test_a_twin_that_rested_twice_without_a_sample_goes_on(spec: TwinSpec) -> None:
    """What its checkpoint is of is not folded once more, as samples that come late."""
    data = pieces(drive(), [450])
    with Twin(SPEC) as unbroken:
        for piece in data:
            unbroken.push(piece)
        expected = said(unbroken)
    with Twin(spec) as twin:
        twin.push(data[0])
        twin.going().rest()
    for _ in range(2):
        with Twin(spec) as twin:
            twin.going().rest()
    with Twin(spec) as twin:
        twin.push(data[1])
        assert said(twin) == expected


def test_other_settings_begin_another_run(spec: TwinSpec) -> None:
    data = pieces(drive(), [300])
    for requirement, piece in zip((0.02, 0.05, 0.05), data, strict=True):
        rule = replace(spec.anomaly, requirement=requirement)
        with Twin(replace(spec, anomaly=rule)) as twin:
            twin.push(piece)
            kinds = [e.kind for e in twin.events]
    assert kinds.count("started") == 2
    with Twin(replace(spec, anomaly=rule)) as twin:
        assert [e.reason for e in twin.events if e.kind == "ran"] == [
            "run 1 ends: the twin file says otherwise from here on"
        ]
        twin.push({k: v + 300.0 * (k == "t") for k, v in data[2].items()})
        assert twin.finish().samples == 900  # those of the first run are not in it


def test_what_was_pushed_before_a_run_began_is_not_lost(spec: TwinSpec) -> None:
    data = drive(100)
    with Twin(spec) as twin:
        twin.push({k: v[:20] for k, v in data.items()})  # too few for their rate
    with Twin(spec) as twin:
        twin.push({k: v[20:] for k, v in data.items()})
        assert twin.finish().samples == 100
    with Twin(spec) as twin:
        twin.push({k: v + 1000.0 * (k == "t") for k, v in data.items()})
        assert twin.finish().samples == 100  # a run of its own


def test_arrays_stand_beside_the_rows_and_old_samples_go(
    spec: TwinSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evertwin.loop.run.SECONDS", 0.0)
    monkeypatch.setattr("evertwin.loop.run.SHARE", 0.0)
    monkeypatch.setattr("evertwin.rows.samples.SECONDS", 0.0)
    source = (replace(SPEC.source[0], keep=300.0),)
    spec = replace(spec, source=source, array=(ArraySpec("lidar", (4, 2), keep=100.0),))
    scan = np.arange(8, dtype=np.float32).reshape(1, 4, 2)
    with Twin(spec) as twin:
        for piece in pieces(drive(), [30]):
            twin.push(piece)
            twin.push(Chunk("lidar", (piece["t"][-1:] * 1e9).astype(np.int64), scan))
        scans = list(twin.samples("lidar"))
        # how many are left depends on when checkpoints were written, which may need the others
        assert 4 <= len(scans) < 30 and int(scans[-1].t[0]) == 899 * 10**9
        assert scans[0].v.dtype == np.float32 and np.array_equal(scans[0].v, scan)
        kept = list(twin.samples("log"))
        assert 0 < kept[0].t[0] / 1e9 <= 600
        assert [len(c.t) for c in twin.samples("log", 890.0, 1e6)] == [10]
        with pytest.raises(DataError, match=r"lidar.*1 arrays of shape \(4, 2\)"):
            twin.push(Chunk("lidar", np.array([0]), scan[:, :3]))
        before = said(twin)
    with Twin(spec) as twin:  # the samples before its checkpoint are gone
        twin.push(Chunk("log", np.array([900 * 10**9]), np.array([[0.0, 100.0]])))
        assert said(twin)[: len(before)] == before
        assert twin.finish().samples == 901


def test_a_source_may_be_late_or_silent() -> None:
    fast = SourceSpec("wheels", {"v": ChannelSpec("v", unit="m/s")})
    slow = SourceSpec("camera", {"x": ChannelSpec("x", unit="m")}, timeout=2.0)
    spec = replace(SPEC, source=(fast, slow), beat=Span(10))
    late = replace(spec, source=(replace(fast, slack=5.0), slow))
    t = np.arange(100) * 10**9
    seen = []
    for one in (spec, late):
        with Twin(one) as twin:
            twin.push(Chunk("wheels", t, np.full((100, 1), 0.1)))
            twin.push(Chunk("camera", t, np.arange(100.0)[:, None] / 10))
            twin.push(Chunk("wheels", t + 100 * 10**9, np.full((100, 1), 0.1)))
            seen.append(int(twin.view().row[-1]))
            twin.push(Chunk("", np.array([300 * 10**9]), np.zeros((1, 0))))
            seen.append(int(twin.view().row[-1]))  # the camera is no longer waited for
    assert seen == [99, 199, 99, 194]


def test_the_operator_is_heard_while_it_runs() -> None:
    data = pieces(drive(), [300])
    with Twin(SPEC) as twin:
        twin.push(data[0])
        assert twin.champion.number == 1
        assert twin.view(1).version.tolist() == [1]
        twin.pin(0, "it squeaks")
        twin.push(data[1])
        assert set(twin.view(280).version.tolist()) == {0}
        assert [e.reason for e in twin.events if e.kind == "pinned"] == [
            "version 0 pinned: it squeaks"
        ]


def test_misuse_is_named() -> None:
    with Twin(SPEC) as twin:
        with pytest.raises(UsageError, match="no samples were pushed"):
            twin.view()
        with pytest.raises(DataError, match="expected x too"):
            twin.push({"t": [0.0], "v": [0.0]})
        with pytest.raises(DataError, match="camera"):
            twin.push(Chunk("camera", np.array([0]), np.zeros((1, 2))))


def test_samples_that_do_not_fit_are_not_stored(spec: TwinSpec) -> None:
    data = pieces(drive(), [300, 300, 300])
    with Twin(spec) as twin:
        twin.push(data[0])
        with pytest.raises(DataError, match="expected 2 columns"):
            twin.push(Chunk("log", np.array([10**12]), np.zeros((1, 3))))
        twin.push(data[1])
        before = said(twin)
    with Twin(spec) as twin:
        twin.push(data[2])
        assert said(twin)[: len(before)] == before


# ---------------------------------------------------------------------- slow work elsewhere


class Elsewhere(InProcess):
    """A worker in another process, as far as the fold can tell, that is told when it is done."""

    workers = 1

    def __init__(self) -> None:
        super().__init__()
        self.done = False

    def answers(self, until: int | None = None) -> tuple[Answer, ...]:
        return super().answers(until) if self.done or until is not None else ()


def with_worker(spec: TwinSpec) -> tuple[Twin, Elsewhere]:
    twin = Twin(replace(spec, engine=EngineSpec(workers=1)))
    twin._engines._engines[1] = worker = Elsewhere()
    return twin, worker


def told(twin: Twin) -> list[tuple[int, str, str]]:
    return [entry[1:5] for entry in twin.store.entries()]  # type: ignore[misc]


def glitches() -> dict[str, np.ndarray]:
    """Single absurd values all along: events, whatever else goes on."""
    data = drive()
    data["x"][50::40] += 1e3
    return data


@pytest.fixture
def spec(tmp_path: Path) -> TwinSpec:
    return replace(SPEC, store=StoreSpec("twin.db"), folder=str(tmp_path))


def test_a_push_does_not_wait_for_slow_work() -> None:
    twin, worker = with_worker(SPEC)
    with twin:
        for number, piece in enumerate(pieces(drive(), [20])):
            worker.done = number == 30
            twin.push(piece)
        answers = [e for e in twin.store.entries() if e.kind == "answer"]
        asked = next(e for e in twin.store.entries() if e.kind == "request")
        assert [e.row for e in answers] == [600] and asked.row < 400


@pytest.mark.parametrize("workers", [0, 1])
@pytest.mark.parametrize("done", [False, True])
def test_a_twin_that_died_while_work_was_open_goes_on(
    spec: TwinSpec, workers: int, done: bool
) -> None:
    """Its log went on past the row where the answer was due: a repeated run keeps to that."""
    parts = pieces(glitches(), [20])
    twin, _ = with_worker(spec)
    with twin:
        for piece in parts[:35]:
            twin.push(piece)
        before = told(twin)
    asked = next(row for _, kind, row, _ in before if kind == "request")
    assert max(row for _, _, row, _ in before) > asked + 50 and "answer" not in {
        e[1] for e in before
    }
    twin, worker = with_worker(spec) if workers else (Twin(spec), Elsewhere())
    worker.done = done
    with twin:
        for piece in parts[35:]:
            twin.push(piece)
        twin.finish()
        after = told(twin)
    assert after[: len(before)] == before
    assert [e[1] for e in after].count("answer") >= 1


def test_a_twin_with_processes_that_died_goes_on(spec: TwinSpec) -> None:
    parts, logs = pieces(drive(), [20]), []
    for part, workers in ((parts[:20], 1), (parts[20:30], 0), (parts[30:], 1)):
        with Twin(replace(spec, engine=EngineSpec(workers=workers))) as twin:
            for piece in part:
                twin.push(piece)
            logs.append(told(twin))
    assert logs[1][: len(logs[0])] == logs[0] and logs[2][: len(logs[1])] == logs[1]
    assert "answer" in {kind for _, kind, *_ in logs[2]}
