"""An empty cell of a command is a value that was lost where each row has one, and no new command
where it comes by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameter, Parameters, Twin, TwinSpec
from evertwin.config import spec
from evertwin.fold import Chunk, Mark
from evertwin.signals import Layout as Channels
from evertwin.sync import Align, Feed
from planted.draws import first_of

TRUE = {"m": 2.4, "c": 1.7, "k": 35.0}


def step(x: Any, u: Any, dt: float, p: Any) -> Any:
    q, v, h = x[0], x[1], dt / 5
    for _ in range(5):
        a = (u[0] - p[1] * v - p[2] * q) / p[0]
        middle = v + 0.5 * h * a
        a = (u[0] - p[1] * middle - p[2] * (q + 0.5 * h * v)) / p[0]
        q, v = q + h * middle, v + h * a
    return [q, v], [q, v]


def twin_of(**signals: spec.SignalSpec) -> Twin:
    both = Layout.of(pos="m", vel="m/s")
    low_high = {"m": (1.0, "kg", 0.1, 20.0), "c": (1.0, "N*s/m", 0.0, 50.0),
                "k": (20.0, "N/m", 0.0, 500.0)}  # fmt: skip
    numbers = Parameters(tuple(Parameter(n, v, u, a, b) for n, (v, u, a, b) in low_high.items()))
    return Twin(
        TwinSpec(
            "mass", spec.ModelSpec("python"), prediction=spec.PredictionSpec(horizon=0.5),
            anomaly=spec.AnomalySpec(requirement=0.002, relative=False, outputs=("pos",)),
            signals=signals,
        ),
        FunctionModel(step, Layout.of(F="N"), both, both, numbers),
    )  # fmt: skip


def recording(seed: int, n: int = 2000, dt: float = 0.02) -> dict[str, Any]:
    """A mass on a spring, its force held over 25 rows."""
    rng = np.random.default_rng(seed)
    force, x, seen = np.repeat(rng.uniform(-20, 20, n // 25 + 1), 25)[:n], np.zeros(2), []
    for i in range(n):
        seen.append(x)
        for _ in range(2):
            x = np.array(step(x, force[i : i + 1], dt / 2, list(TRUE.values()))[0])
    pos, vel = np.array(seen).T
    return {
        "t": np.arange(n) * dt, "F": force, "pos": pos + rng.normal(0, 1e-4, n),
        "vel": vel + rng.normal(0, 1e-3, n),
    }  # fmt: skip


def holed(rows: dict[str, Any], seed: int, size: int = 20, many: int = 4) -> dict[str, Any]:
    force, rng = rows["F"].copy(), np.random.default_rng(seed + 99)
    # apart from each other, and none in the first rows
    for first in 100 + 480 * np.arange(many) + rng.integers(0, 400, many):
        force[first : first + size] = np.nan
    return {**rows, "F": force}


@first_of("seed", range(5))
@pytest.mark.parametrize("size", [10, 20, 40])
def test_a_fit_begins_anew_behind_lost_commands(seed: int, size: int) -> None:
    found = twin_of().fit(holed(recording(seed), seed, size))
    assert found.without == {"F": 4 * size} and f"{4 * size} of F" in str(found)
    assert found.to_dict()["rows_without_input"] == {"F": 4 * size}
    assert found.held is not None and found.held.reached
    for name, value in TRUE.items():
        assert found.fit[name] == pytest.approx(value, rel=2e-3)


def test_a_run_says_where_and_is_not_led_astray() -> None:
    data = holed(recording(1), 1)
    result = twin_of().run(data)
    firsts = np.flatnonzero(np.diff(np.isnan(data["F"]).astype(int)) == 1) + 1
    assert [event.row for event in result.of_kind("unknown")] == firsts.tolist()
    assert result.outputs["pos"].rms_after < 1e-3


def test_hold_in_the_twin_file_is_kept() -> None:
    rows = recording(2)
    changes = np.r_[True, np.diff(rows["F"]) != 0.0]
    said = {"F": spec.SignalSpec(hold=True)}
    for force in (np.where(changes, rows["F"], np.nan), rows["F"]):
        found = twin_of(**said).fit({**rows, "F": force})
        assert found.without == {} and found.fit["k"] == pytest.approx(35.0, rel=2e-3)


@pytest.mark.parametrize("every", [2, 5])
def test_a_command_that_comes_seldom_acts_until_the_next(every: int) -> None:
    """Its cells are empty between two commands, or in rows that are another source's."""
    rows = recording(3)
    sparse = np.where(np.arange(2000) % every == 0, rows["F"], np.nan)
    assert twin_of().fit({**rows, "F": sparse}).without == {}
    both = {name: np.repeat(column, 2) for name, column in rows.items()}
    own = np.arange(4000) % 2 == 0  # two tables in one, as outer joins make them
    both["t"] = both["t"] + np.where(own, 0.0, 0.01)
    both["F"] = np.where(own, both["F"], np.nan)
    for name in ("pos", "vel"):
        both[name] = np.where(own, np.nan, both[name])
    assert twin_of().fit(both).without == {}


@pytest.mark.parametrize("cuts", [1, 7, 100])
@pytest.mark.parametrize("rate", [None, 100.0])
def test_rows_do_not_hang_on_how_samples_were_cut(cuts: int, rate: float | None) -> None:
    rng = np.random.default_rng(0)
    v, t = rng.normal(size=(300, 2)), np.arange(300) * 10**7
    v[120:135, 0], v[200, 0] = np.nan, np.inf
    align = Align(Channels.of(v="m/s"), Channels.of(x="m"), (Feed("log", ("v", "x")),), rate=rate)

    def rows(size: int) -> list[np.ndarray]:
        state, parts = align.init(), []
        for k in range(0, 300, size):
            state, out = align.step(state, Chunk("log", t[k : k + size], v[k : k + size]))
            parts.append(out.rows)
        parts.append(align.flush(state)[1].rows)
        return [np.concatenate(c) for c in zip(*(p for p in parts if p), strict=True)]

    for one, whole in zip(rows(cuts), rows(300), strict=True):
        np.testing.assert_array_equal(one, whole)
    u, mark = rows(300)[3][:, 0], rows(300)[5][:, 0]
    unknown = np.flatnonzero(np.isnan(u))
    assert unknown.tolist() == [*range(121, 136), 201]
    assert (mark[unknown] == Mark.ABSENT).all()


@pytest.mark.parametrize("cut", [1, 7, 5000])
def test_what_drops_out_all_the_time_is_told_ever_more_seldom(cut: int) -> None:
    """Two values in a hundred are sentinels: of 100 losses 11 are told, of four tasks together."""
    t, v = np.arange(5000) * 10**8, np.random.default_rng(0).normal(size=(5000, 2))
    v[20::50, 0] = np.inf
    align = Align(Channels.of(v="m/s"), Channels.of(x="m"), (Feed("log", ("v", "x")),))
    state, told = align.init(), list[Any]()
    for first in range(0, 5000, 1250):
        for k in range(first, first + 1250, cut):
            stop = min(k + cut, first + 1250)
            state, out = align.step(state, Chunk("log", t[k:stop], v[k:stop], first // 1250))
            told += out.records
    told += align.flush(state)[1].records
    lost = [event for event in told if event.kind == "unknown"]
    assert [event.evidence["samples"] for event in lost] == [*range(1, 9), 16, 32, 64]
    assert "times so far" not in lost[7].reason and lost[8].reason.endswith("; 16 times so far")
