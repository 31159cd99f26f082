"""A run that follows its machine in the stream, and what it hands on to the next one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from evertwin.config.spec import (
    AnomalySpec,
    ModelSpec,
    MovingSpec,
    SignalSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.errors import ConfigError
from evertwin.fold import Mark, plain, take
from evertwin.outcome.result import RunResult
from evertwin.prognosis.histories.parameter_history import history
from evertwin.store import Estimate, SqliteStore
from evertwin.twin import Twin

from .test_recursive_fit import SPEC, recording

FOLLOWS = replace(
    SPEC,
    beat=Span(50),
    tuning=replace(SPEC.tuning, method="recursive"),
    # nothing is ever suspected: what is learned is learned in the stream
    anomaly=AnomalySpec(requirement=100.0),
)
KNOWN = {f"{kind}{k}": 4.0 for kind in ("Fc", "Fv") for k in range(1, 7)}


def known(store: SqliteStore | None = None, **changes: Any) -> Twin:
    """A twin whose live version has the friction of a day before."""
    twin = Twin(replace(FOLLOWS, **changes), store=store)
    if not any(v.values != twin.version(0).values for v in twin.versions):
        version = twin._ledger.keep(twin.champion.form, KNOWN, "commissioned")
        twin.promote(version.number)
    return twin


def off(result: RunResult, first: int, last: int) -> float:
    """Deviation of the wrist, whose torques are friction, while it moves."""
    trace = result.trace
    rows = slice(first, last)
    moves = np.abs(trace["input"][rows, 9:12]) > 0.05
    residual, measured = (trace[name][rows, 3:][moves] for name in ("residual", "measured"))
    return float(np.sqrt(np.mean(residual**2) / np.mean(measured**2)))


def test_a_run_follows_what_has_changed_and_shows_it() -> None:
    data = recording(2, 5.2, 1500)
    with known() as twin:
        stays = replace(FOLLOWS, tuning=replace(FOLLOWS.tuning, method="auto"))
        result = twin.run(data)
        assert twin.champion.number == 1  # followed, not replaced
    with Twin(stays) as fixed:
        fixed.promote(fixed._ledger.keep(fixed.champion.form, KNOWN, "commissioned").number)
        before = off(fixed.run(data), 750, 1500)
    assert off(result, 750, 1500) < 0.3 * before
    for k in range(4, 7):
        assert result.parameters[f"Fc{k}"].value == pytest.approx(5.2, rel=0.1)


@pytest.mark.parametrize("edges", [(1, 2, 49, 50, 51, 333), tuple(range(7, 600, 7))])
def test_where_rows_are_cut_changes_nothing(edges: tuple[int, ...]) -> None:
    (rows,) = known().blocks(recording(2, 5.2, 600))
    whole = known().run([rows])
    parts = [take(rows, a, b) for a, b in pairwise((0, *edges, 600))]
    cut = known().run(parts)
    for name, column in whole.trace.items():
        assert np.array_equal(column, cut.trace[name], equal_nan=column.dtype.kind == "f"), name
    assert cut.parameters.values.tolist() == whole.parameters.values.tolist()
    assert [plain(e) for e in cut.events] == [plain(e) for e in whole.events]


def test_what_is_not_linear_cannot_be_followed_by_a_run() -> None:
    spec = TwinSpec("robot", ModelSpec("robot1d"), tuning=TuningSpec(method="recursive"))
    t = np.arange(100) * 0.1
    with pytest.raises(ConfigError, match="linear in every editable"):
        Twin(spec).run({"t": t, "v": np.full(100, 0.2), "x": 0.2 * t})


def test_what_is_followed_is_said_and_goes_into_the_parameter_history() -> None:
    store = SqliteStore(":memory:")
    for seed in range(3):
        result = known(store).run(recording(seed, 4.8, 600))
    (said,) = result.of_kind("followed")
    assert said.row == 600 and "follows the machine" in said.reason
    left: Any = said.evidence["left"]
    assert left[said.signal] == min(left.values()) < 0.5
    kept = [one for one in store.read("estimate") if isinstance(one, Estimate)]
    last = {one.name: one for one in kept if one.tasks_before == 2}
    for name in ("Fc4", "Fc5", "Fc6"):
        assert last[name].low < 4.8 < last[name].high, last[name]
        assert last[name].value == result.parameters[name].value
        assert last[name].verdict == "identifiable"
    times = history(store, "s").moments
    assert len(times) == 3 and "Fc5" in times[-1].found


def test_a_pinned_version_stays_as_it_is() -> None:
    with known() as twin:
        twin.pin(1)
        result = twin.run(recording(2, 5.2, 1000))
    assert result.parameters["Fc5"].value == 4.0


def test_short_recordings_accumulate_in_a_store() -> None:
    data = [recording(seed, 5.2, 200) for seed in range(4)]
    store = SqliteStore(":memory:")
    with known(store) as twin:
        first, *_, last = [twin.run(one) for one in data]
    with known() as twin:
        alone = twin.run(data[-1])
    assert off(last, 0, 50) < 0.5 * off(alone, 0, 50)
    assert off(first, 0, 50) == pytest.approx(off(alone, 0, 50), rel=0.5)


def test_a_run_that_goes_on_from_another_one_is_repeated_as_it_was() -> None:
    store = SqliteStore(":memory:")
    data = [recording(seed, 5.2, 300) for seed in range(2)]
    results = [known(store).run(one) for one in data]
    again = known(store).run(data[1])
    assert np.array_equal(again.trace["predicted"], results[1].trace["predicted"], equal_nan=True)


def test_a_repeated_run_that_was_asked_for_begins_from_nothing() -> None:
    store = SqliteStore(":memory:")
    data = recording(2, 5.2, 300)
    with known(store) as twin:
        first, second = twin.run(data), twin.run(data, again=True)
    assert np.array_equal(first.trace["predicted"], second.trace["predicted"], equal_nan=True)


def test_an_input_that_no_machine_can_have_spoils_its_own_row_alone() -> None:
    signals = {f"qd{k}": SignalSpec(low=-10.0, high=10.0) for k in range(1, 7)}
    data = recording(2, 5.2, 600)
    clean = known(signals=signals).run(data)
    data["qd2"] = data["qd2"].copy()
    data["qd2"][300:303] = 1e30
    found = known(signals=signals).run(data)
    said = [e for e in found.events if e.signal == "qd2"]
    assert (said[0].kind, said[0].row) == ("measurement_error", 300)
    assert "physically possible" in said[0].reason
    assert np.isnan(found.trace["predicted"][300:303]).all()
    assert off(found, 303, 600) == pytest.approx(off(clean, 303, 600), rel=0.05)
    assert Mark.ERROR not in found.trace["mark"][303:]


def test_an_output_that_nothing_is_said_of_moves_always() -> None:
    moving = MovingSpec(above=0.05, channels={"tau6": "qd6"})
    with known(moving=moving) as twin:
        assert twin.run(recording(2, 5.2, 600)).parameters["Fc5"].value > 4.2
