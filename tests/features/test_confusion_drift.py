"""Labels as they come against those known: the laws of a stage, what is told, and what is not."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.errors import DataError, UsageError
from evertwin.features.images.confusion_drift import ConfusionDrift, DriftState
from evertwin.features.images.labelled import Labelled
from evertwin.fold import Chunk, Event
from evertwin.fold.state import copy, equal, load, save

NAMES = ("box", "person", "table")
KNOWN = np.array([[0.93, 0.05, 0.02], [0.03, 0.94, 0.03], [0.1, 0.02, 0.88]])
OTHER = np.array([[0.83, 0.15, 0.02], [0.03, 0.94, 0.03], [0.1, 0.02, 0.88]])


def drawn(seed: int, table: np.ndarray, n: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    truth = rng.integers(3, size=n)
    said = (rng.random(n)[:, None] > table.cumsum(axis=1)[truth]).sum(axis=1)
    return np.column_stack([truth, np.minimum(said, 2), np.full(n, 0.9)]).astype(np.float64)


def stage(seed: int = 0, n: int = 1500) -> ConfusionDrift:
    truth, said = drawn(seed, KNOWN, n)[:, :2].astype(np.int64).T
    return ConfusionDrift(
        "labels", Labelled(NAMES, truth, said, np.ones(n, np.bool_), np.full(n, np.nan))
    )


def told(
    on: ConfusionDrift, rows: np.ndarray, state: DriftState | None = None, first: int = 0
) -> tuple[DriftState, list[Event]]:
    state = on.init() if state is None else state
    chunk = Chunk("labels", np.arange(first, first + len(rows)), rows)
    state, out = on.step(state, chunk)
    return state, [one for one in out.records if isinstance(one, Event)]


def test_a_cell_that_drifts_is_named_and_nothing_before() -> None:
    on = stage()
    state, before = told(on, drawn(1, KNOWN, 2000))
    assert before == []
    state, events = told(on, drawn(2, OTHER, 3000), state, 2000)
    assert [one.kind for one in events] == ["confusions_drift"]
    (cell,) = events[0].evidence["cells"]  # type: ignore[misc, union-attr]
    assert (cell["truth"], cell["label"]) == ("box", "person")
    assert cell["known"]["share"] < 0.08 < cell["now"]["low"]
    assert "box is taken for person" in events[0].reason
    _, after = told(on, drawn(3, KNOWN, 8000), state, 5000)
    assert [one.kind for one in after] == ["confusions_back"]


def test_the_laws_of_a_stage_hold() -> None:
    on, rows = stage(), np.concatenate([drawn(1, KNOWN, 900), drawn(2, OTHER, 1500)])
    rows[5, 1] = np.nan  # nothing was said
    whole, events = told(on, rows)
    state, parts, rng = on.init(), list[Event](), np.random.default_rng(4)
    at = 0
    while at < len(rows):
        stop = at + int(rng.integers(1, 200))
        state, more = told(on, rows[at:stop], state, at)
        parts, at = parts + more, min(stop, len(rows))
        state = load(save(copy(state)), like=on.init())
    assert equal(state, whole) and parts == events and len(events) > 0


def test_a_truth_that_is_not_known_is_told_once() -> None:
    on = stage()
    known = on.known
    rows = drawn(1, KNOWN, 1600)
    kept = known.truth != 2
    fewer = Labelled(NAMES, known.truth[kept], known.label[kept], known.simulated[kept],
                     known.probability[kept])  # fmt: skip
    _, events = told(ConfusionDrift("labels", fewer), rows)
    assert [(one.kind, one.evidence["truth"]) for one in events] == [
        ("confusions_unknown", "table")
    ]


def test_what_is_wrong_is_named() -> None:
    on = stage()
    with pytest.raises(DataError, match="expected 3 values"):
        told(on, np.zeros((1, 2)))
    with pytest.raises(DataError, match=r"0 to 2 \(box, person, table\), got \[3. 0.\]"):
        told(on, np.array([[3.0, 0.0, 0.5]]))
    with pytest.raises(UsageError, match="so rare ones cannot be told"):
        ConfusionDrift("labels", on.known, 1e9)


def csv(file: Path, rows: np.ndarray) -> Path:
    lines = [f"{NAMES[int(a)]},{NAMES[int(b)]},{p}" for a, b, p in rows]
    file.write_text("\n".join(["truth,label,probability", *lines, ""]))
    return file


def test_the_command_reads_a_file_and_what_comes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    known = csv(tmp_path / "known.csv", drawn(0, KNOWN, 1500))
    new = csv(tmp_path / "new.csv", np.concatenate([drawn(1, KNOWN, 800), drawn(2, OTHER, 1600)]))
    with pytest.raises(SystemExit) as ended:
        main(["confusions", str(known), str(new), "--drift", "200000", "--json", "--check"])
    content = json.loads(capsys.readouterr().out)
    assert ended.value.code == 1 and content["labels"] == 2400
    assert content["drifted"] == [{"truth": "box", "label": "person"}]
    new.write_text(new.read_text() + "lamp,box,0.5\n")
    monkeypatch.setattr("sys.stdin", io.StringIO(new.read_text()))
    with pytest.raises(SystemExit) as ended:
        main(["confusions", str(known), "-", "--drift", "200000", "--json"])
    lines = capsys.readouterr().out.splitlines()
    assert ended.value.code == 0 and [json.loads(line) for line in lines] == content["events"]
    with pytest.raises(SystemExit) as ended:
        main(["confusions", str(known), "--drift", "200000"])
    assert ended.value.code != 0 and "known labels and new ones" in capsys.readouterr().err
