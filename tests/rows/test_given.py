"""Tables that a program holds are read as files are: the same rows, the same words for what is
wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ChannelSpec, ClockSpec, ModelSpec, SourceSpec, Span
from evertwin.errors import DataError, EvertwinError, UsageError
from evertwin.fold import Block
from evertwin.machines.mobile import Robot1D
from evertwin.rows import Feed
from evertwin.rows.given import given
from evertwin.sources.spec import TimeSpec

SPEC = TwinSpec("cart", ModelSpec("robot1d"))
LOG = SourceSpec(
    "log", {"v": ChannelSpec("v", "cm/s"), "x": ChannelSpec("way", "mm", sentinels=(-999.0,))},
    time=TimeSpec("clock"),
)  # fmt: skip
FILED = replace(SPEC, source=(LOG,))
STAMPS = pd.Timestamp("2027-03-01") + pd.to_timedelta(np.arange(300) * 0.02, unit="s")


def frame(seed: int = 1, n: int = 300) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(0.0, 0.2, n // 10), 10)
    return pd.DataFrame({"t": 0.02 * np.arange(n), "v": v, "x": np.cumsum(0.02 * v)})


def filed(seed: int = 1) -> pd.DataFrame:
    """The same in the units and with the names of the file."""
    table = frame(seed)
    return pd.DataFrame({"clock": table.t, "v": 100 * table.v, "way": 1000 * table.x})


def rows(data: Any, spec: TwinSpec = SPEC) -> Block:
    (block,) = Feed(spec, Robot1D()).blocks(data)
    return block


def alike(one: Block, other: Block) -> bool:
    pairs = zip((one.t, one.u, one.y), (other.t, other.u, other.y), strict=True)
    return all(np.allclose(a, b, rtol=1e-12, atol=1e-12, equal_nan=True) for a, b in pairs)


def with_index(index: Any) -> pd.DataFrame:
    return frame().drop(columns="t").set_index(pd.Index(index))


SAME: dict[str, Callable[[], Any]] = {
    "mapping": lambda: {name: column.to_numpy() for name, column in frame().items()},
    "lists": lambda: frame().to_dict("list"),
    "Arrow": lambda: pyarrow.Table.from_pandas(frame(), preserve_index=False),
    "Arrow types": lambda: frame().convert_dtypes(dtype_backend="pyarrow"),
    "record array": lambda: frame().to_records(index=False),
    "rows": lambda: frame().to_dict("records"),
    "text": lambda: frame().astype(str),
    "objects": lambda: frame().astype(object),
    "decimals": lambda: frame().map(lambda one: Decimal(str(one))),
    "nullable": lambda: frame().convert_dtypes(),
    "data set": lambda: frame().set_index("t").to_xarray(),
    "index named t": lambda: frame().set_index("t"),
    "index of seconds": lambda: with_index(frame().t.to_numpy()),
    "durations": lambda: frame().assign(t=pd.to_timedelta(frame().t, unit="s")),
    "a word beside": lambda: frame().assign(who="me", why=1j),
}


@pytest.mark.parametrize("kind", SAME)
def test_what_has_columns_by_name_gives_the_rows_of_the_frame(kind: str) -> None:
    assert alike(rows(SAME[kind]()), rows(frame()))


DATED: dict[str, Callable[[], Any]] = {
    "index": lambda: with_index(STAMPS),
    "zone": lambda: frame().assign(t=STAMPS.tz_localize("UTC").tz_convert("Europe/Berlin")),
    "index with a zone": lambda: with_index(STAMPS.tz_localize("UTC").tz_convert("Asia/Tokyo")),
    "text": lambda: frame().assign(t=[one.isoformat() for one in STAMPS]),
    "datetime": lambda: {**frame(), "t": [one.to_pydatetime() for one in STAMPS]},
    "datetime with a zone": lambda: {
        **frame(), "t": [one.to_pydatetime() for one in STAMPS.tz_localize("UTC")]
    },
    "ns": lambda: frame().assign(t=STAMPS.as_unit("ns").astype(np.int64)),
    "us": lambda: frame().assign(t=STAMPS.as_unit("us").astype(np.int64)),
    "ms": lambda: frame().assign(t=STAMPS.as_unit("ms").astype(np.int64)),
    "index in ms": lambda: with_index(STAMPS.as_unit("ms").astype(np.int64)),
}  # fmt: skip


@pytest.mark.parametrize("kind", DATED)
def test_dates_are_read_however_they_are_held(kind: str) -> None:
    assert alike(rows(DATED[kind]()), rows(frame().assign(t=STAMPS)))


def test_integers_since_1970_are_told() -> None:
    feed = Feed(SPEC, Robot1D())
    list(feed.blocks(DATED["ns"]()))
    (tally,) = feed.left_out
    assert str(tally) == "columns: t read in ns (counted from 1970)" and not tally.finding


@pytest.mark.parametrize(
    "table", [frame().drop(columns="t"), frame().drop(columns="t")[frame().x > 0.001]]
)
def test_the_numbers_of_rows_are_no_time(table: pd.DataFrame) -> None:
    with pytest.raises(DataError, match=r"no time: expected a column 't'.*got v, x: name one so"):
        rows(table)
    at = replace(SPEC, clock=ClockSpec(rate=50.0))
    feed = Feed(at, Robot1D())
    (block,) = feed.blocks(table)
    assert np.allclose(np.diff(block.t), 20_000_000) and len(block.t) == len(table)
    assert "rows at 50 Hz, the [clock] rate" in str(feed.left_out[0])


DISORDER: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "sorted": lambda table: table,
    "backward": lambda table: table[::-1],
    "shuffled": lambda table: table.sample(frac=1, random_state=1),
    "late": lambda table: pd.concat([table[:100], table[150:], table[100:150]]),
    "twice": lambda table: pd.concat([table, table.assign(v=1.0)]).sort_values("clock"),
    "holes": lambda table: table.assign(way=table.way.where(table.index % 7 > 0)),
    "beyond": lambda table: table.assign(way=table.way.where(table.index != 9, 1e300)),
    "since 1970": lambda table: table.assign(clock=1.8e9 + table.clock),
}


@pytest.mark.parametrize("kind", DISORDER)
def test_a_table_is_read_as_the_file_that_it_was_read_from(kind: str, tmp_path: Path) -> None:
    table, file = DISORDER[kind](filed()), tmp_path / "log.csv"
    table.to_csv(file, index=False)
    held, read = Feed(FILED, Robot1D()), Feed(FILED, Robot1D())
    assert alike(next(held.blocks(table)), next(read.blocks(file)))
    said = [feed.tallies["log"] for feed in (held, read)]
    assert said[0].counts == said[1].counts and said[0].suspicions == said[1].suspicions
    assert said[0].used == said[1].used and said[0].finding == said[1].finding


def test_a_frame_has_the_units_of_the_file_and_a_mapping_those_of_the_model() -> None:
    assert alike(rows(filed(), FILED), rows(frame(), FILED))
    assert alike(rows(filed().to_dict("list"), FILED), rows(frame(), FILED))
    same = replace(LOG, channels={n: ChannelSpec(n, "mm") for n in "vx"}, time=TimeSpec("t"))
    spec = replace(
        SPEC, source=(replace(same, channels={**same.channels, "v": LOG.channels["v"]}),)
    )
    thousand = frame().assign(v=100 * frame().v, x=1000 * frame().x)
    feed = Feed(spec, Robot1D())
    assert alike(next(feed.blocks(thousand)), rows(frame()))
    assert "read as the twin file says of source log: v in cm/s, x in mm" in str(feed.left_out[0])
    assert alike(rows(SAME["mapping"](), spec), rows(frame()))


def test_several_frames_are_recordings_one_after_the_other() -> None:
    for spec, table in ((SPEC, frame()), (FILED, filed())):
        blocks = list(Feed(spec, Robot1D()).blocks([table, table]))
        assert [len(block.t) for block in blocks] == [300, 300]
        assert np.array_equal(blocks[0].y, blocks[1].y)


def test_a_masked_value_is_none() -> None:
    mask = np.arange(300) % 50 == 3
    x = np.ma.masked_array(np.where(mask, 1e3, frame().x), mask=mask)
    block = rows({"t": frame().t, "v": frame().v, "x": x})
    assert np.array_equal(np.isnan(block.y[:, 0]), mask)
    t = np.ma.masked_array(frame().t, mask=mask)
    feed = Feed(SPEC, Robot1D())
    assert len(next(feed.blocks({"t": t, "v": frame().v, "x": frame().x})).t) == 294
    assert feed.tallies["columns"].counts["no_stamp"] == 6


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (frame().assign(x=1j), "column 'x': expected numbers, got complex128"),
        (frame().assign(x=["error", *["1"] * 299]), r"'x': row 1: expected a number, got 'error'"),
        (frame().assign(x=[object()] * 300), "column 'x': expected numbers, got object"),
        ({**frame(), "v": frame().v.to_numpy()[:, None]}, r"'v': expected 300 .* \(300, 1\)"),
        ({**frame(), "v": 0.0}, r"column 'v': expected 300 values as 't' has"),
        (frame().assign(t="soon"), "column 't'.*expected a stamp"),
        (pd.concat([frame(), frame()[["x"]]], axis=1), "2 columns are called 'x': rename"),
        (frame().to_numpy(), "got ndarray: name its columns"),
        (frame().x, "got Series: name its columns"),
        ((table for table in [frame()]), "got one of DataFrame: give recordings as a list"),
        (frame().rename(columns={"x": "way"}), "'x' is neither recorded .*there are v, way"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_column(data: Any, said: str) -> None:
    with Twin(SPEC) as twin, pytest.raises(EvertwinError, match=said):
        twin.run(data)


def test_one_of_several_that_is_no_table_is_named() -> None:
    with pytest.raises(UsageError, match="or a list of these, got float: name its columns"):
        given(SPEC, Robot1D(), [frame(), 3.0])


def test_a_file_of_a_twin_without_sources_is_refused_with_what_to_do(tmp_path: Path) -> None:
    frame().to_csv(tmp_path / "log.csv")
    with Twin(SPEC) as twin, pytest.raises(DataError, match=r"it has none.*write \[\[source\]\]"):
        twin.run(tmp_path / "log.csv")


@pytest.mark.parametrize("spec", [SPEC, FILED], ids=["channels", "as the file"])
def test_samples_are_pushed_as_frames_and_as_numbers(spec: TwinSpec) -> None:
    table = filed() if spec is FILED else frame()
    with Twin(spec) as twin:
        twin.push(table[:100])
        for row in table[100:200].to_dict("records"):
            twin.push(row)
        twin.push({name: column.to_numpy()[200:] for name, column in table.items()})
        view = twin.view()
        assert len(view.row) == 300 and np.allclose(view.measured[:, 0], frame().x)


def test_a_frame_of_which_one_row_is_left_is_refused_with_the_reason() -> None:
    beside = replace(FILED, anomaly=AnomalySpec(window=Span(seconds=60.0)))
    with Twin(beside) as twin:
        for call in (twin.fit, twin.run):
            with pytest.raises(DataError, match=r"299 of 300 rows.*sort the rows.*one row is left"):
                call(filed()[::-1])


@pytest.mark.parametrize("kind", ["backward", "shuffled", "twice"])
def test_a_table_that_is_out_of_order_is_not_pushed(kind: str) -> None:
    with Twin(FILED) as twin, pytest.raises(DataError, match=r"samples: .*(sort the rows|repeat)"):
        twin.push(DISORDER[kind](filed()))


@pytest.mark.parametrize("samples", [None, (1, 2), 5, pd.Series([1.0])])
def test_what_holds_no_samples_is_not_pushed(samples: Any) -> None:
    with (
        Twin(SPEC) as twin,
        pytest.raises(UsageError, match="expected a Chunk, or columns by name"),
    ):
        twin.push(samples)


def test_the_doctor_reads_repeated_stamps_of_a_frame() -> None:
    with Twin(FILED) as twin:
        told = str(twin.doctor(DISORDER["twice"](filed())))
    assert "300 repeated, DataFrame line 2" in told
