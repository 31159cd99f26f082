"""A twin that watches what a detector confuses: recorded, pushed, and cut off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import reads
from evertwin.config.spec import (
    ChannelSpec,
    LabelsSpec,
    ModelSpec,
    SourceSpec,
    StoreSpec,
    TimeSpec,
)
from evertwin.errors import ConfigError
from evertwin.fold import Event
from evertwin.rows import Feed
from evertwin.sources.spec import ArraySpec
from tests.features.test_confusion_drift import KNOWN, NAMES, OTHER, csv, drawn

ROWS, EACH = 120, 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cart that stands still, twenty labels a second; from 50 s on boxes look like persons."""
    here = tmp_path_factory.mktemp("labels")
    csv(here / "known.csv", drawn(0, KNOWN, 1500))
    t = np.arange(ROWS, dtype=np.float64)
    np.savetxt(here / "log.csv", np.column_stack([t, 0.1 + 0 * t, 0.1 * t]), delimiter=",",
               header="t,v,x", comments="")  # fmt: skip
    said = np.concatenate([drawn(1, KNOWN, 50 * EACH), drawn(2, OTHER, (ROWS - 50) * EACH)])
    stamps = np.arange(len(said)) / EACH
    np.savetxt(here / "said.csv", np.column_stack([stamps, said]), delimiter=",", comments="",
               header="t,values.1,values.2,values.3")  # fmt: skip
    return here


def spec_of(folder: Path) -> TwinSpec:
    array = ArraySpec("said", (3,), match="said*")
    labels = LabelsSpec("said", "known.csv", NAMES)
    channels = {"v": ChannelSpec("v", "m/s"), "x": ChannelSpec("x", "m")}
    source = SourceSpec("log", channels, match="log*", time=TimeSpec("t", "s"))
    return TwinSpec("cart", ModelSpec("robot1d"), source=(source,), array=(array,), labels=labels,
                    folder=str(folder))  # fmt: skip


def files(folder: Path) -> list[Path]:
    return [folder / "log.csv", folder / "said.csv"]


def test_a_drift_is_an_event_of_the_run(folder: Path) -> None:
    with Twin(spec_of(folder)) as twin:
        result = twin.run(files(folder))
    (event,) = (one for one in result.events if one.kind == "confusions_drift")
    assert "box is taken for person" in event.reason and 50 < event.row <= ROWS
    assert event.signal == "said"


def told(twin: Twin) -> list[tuple[int, str]]:
    """What the log has of it."""
    records = map(twin.store.record, twin.store.entries(kinds=("event",)))
    return [(one.row, one.reason) for one in records
            if isinstance(one, Event) and one.kind == "confusions_drift"]  # fmt: skip


def test_pushed_and_cut_off_the_same_is_told(folder: Path, tmp_path: Path) -> None:
    spec = replace(spec_of(folder), store=StoreSpec(str(tmp_path / "twin.db")))
    with Twin(spec_of(folder)) as twin:
        chunks = list(Feed(twin.spec, twin.model).chunks(files(folder)))
        recorded = twin.run(files(folder))
        expected = [(e.row, e.reason) for e in recorded.events if e.kind == "confusions_drift"]
    with Twin(spec_of(folder)) as twin:
        for chunk in chunks:
            twin.push(chunk)
        pushed = twin.finish()
        assert told(twin) == expected
    assert np.array_equal(pushed.trace["predicted"], recorded.trace["predicted"], equal_nan=True)
    twin = Twin(spec)
    for k, chunk in enumerate(chunks):
        if k == len(chunks) // 2:
            twin.going().rest()
        if k in (len(chunks) // 2 + 99, len(chunks) - 50):
            twin.close()
            twin = Twin(spec)
        twin.push(chunk)
    twin.finish()
    assert told(twin) == expected
    twin.close()


HEAD = """schema = 1
name = "cart"
model = { kind = "robot1d" }
[[array]]
name = "said"
shape = [SHAPE]
[labels]
source = "said"
known = "known.csv"
"""


def test_what_is_wrong_is_named(folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"labels: source: expected the name of an \[\[array"):
        reads(HEAD.replace("SHAPE", "5"), "cart.toml")
    base = spec_of(folder)
    assert base.labels is not None
    for labels, said in (
        (replace(base.labels, known="none.csv"), "cannot be read"),
        (replace(base.labels, classes=("box",)), "expected the classes box, got person"),
    ):
        with Twin(replace(base, labels=labels)) as twin, pytest.raises(ConfigError, match=said):
            twin.run(files(folder))
    four = replace(base, array=(replace(base.array[0], shape=(4,)),))
    with Twin(four) as twin, pytest.raises(ConfigError, match="expected a column 'group'"):
        twin.run(files(folder))
