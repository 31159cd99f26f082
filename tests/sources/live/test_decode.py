"""Columns of a machine → chunks, by the twin file's own channels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.sources.live.contract import LiveSettings
from evertwin.sources.live.decode import Decoder
from evertwin.sources.live.telling import Telling
from evertwin.sources.recorded import Recorded
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec

SPEC = SourceSpec(
    "pump",
    {
        "v": ChannelSpec("speed", "cm/s", scale=0.1, offset=3.0, sentinels=(-999.0,)),
        "T": ChannelSpec("temp", "degC"),
    },
    time=TimeSpec("t", "ms"),
    offset=0.5,
)


def decoder(spec: SourceSpec = SPEC, **settings: object) -> Decoder:
    return Decoder(spec, Telling(spec.name), LiveSettings("pump", "", **settings))  # type: ignore[arg-type]


def test_live_and_recorded_give_the_same_bits(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    rows = [(20 * i, *rng.normal(0, 300, 2).tolist()) for i in range(50)]
    rows[7] = (140, -999.0, 20.0)
    file = tmp_path / "run.csv"
    lines = (",".join(map(repr, row)) for row in rows)
    file.write_text("t,speed,temp\n" + "\n".join(lines) + "\n")
    recorded = list(Recorded.of(SPEC, (file,)).read())
    one = decoder()
    live = [c for t, v, temp in rows for c in one.chunks({"t": t, "speed": v, "temp": temp})]
    assert np.concatenate([c.t for c in live]).tolist() == recorded[0].t.tolist()
    assert np.concatenate([c.v for c in live]).tobytes() == recorded[0].v.tobytes()


def test_what_is_not_there_is_absent_and_counted() -> None:
    one = decoder()
    (chunk,) = one.chunks({"t": 1, "speed": 1.0})
    assert np.isnan(chunk.v[0, 1])
    assert one.chunks({"t": 2}) == [] and one.chunks({"speed": 1.0}) == []
    (chunk,) = one.chunks({"t": 3, "speed": "oops", "temp": True})
    assert np.isnan(chunk.v[0, 0]) and chunk.v[0, 1] == 274.15
    assert one.told.health.rejected == {"no column of the twin in it": 1, "no stamp": 1}
    assert one.told.health.noted == {"speed: not a number": 1}


@pytest.mark.parametrize("stamp", [float("nan"), 1e300, 10**40, "yesterday", b"", True, None])
def test_stamps_that_are_none(stamp: object) -> None:
    one = decoder()
    assert one.chunks({"t": stamp, "speed": 1.0}) == []  # type: ignore[dict-item]
    assert one.told.health.rejected == {"no stamp": 1}


def test_dates_are_stamps_to_the_digit() -> None:
    spec = SourceSpec("pump", {"v": ChannelSpec("v", "1")}, time=TimeSpec("t", "iso"))
    (chunk,) = decoder(spec).chunks({"t": "2026-01-02T03:04:05.123456789Z", "v": 1})
    assert chunk.t[0] % 10**9 == 123456789


def test_stamps_of_arrival_increase() -> None:
    one = decoder(stamp="arrival")
    stamps = [c.t[0] for i in range(50) for c in one.chunks({"speed": i})]
    assert len(stamps) == 50 and (np.diff(stamps) > 0).all()


def test_tasks_open_by_a_channel_a_silence_and_a_period() -> None:
    spec = SourceSpec(
        "pump", SPEC.channels, time=TimeSpec("t", "s"), task="job", where={"on": (1,)}
    )
    one = decoder(spec, pause=5.0)
    said = [(0, 1), (1, 1), (2, 2), (3, 2), (8, 2), (9, None), (10, 2)]
    tasks = [
        c.task for t, job in said for c in one.chunks({"t": t, "job": job, "on": 1, "speed": 1.0})
    ]
    assert tasks == [0, 0, 1, 1, 2, 2, 2]
    assert one.chunks({"t": 11, "on": 0, "speed": 1.0}) == []
    every = decoder(every=2.0)
    assert [c.task for t in range(6) for c in every.chunks({"t": 1000 * t, "speed": 1.0})] == [
        0, 0, 1, 1, 2, 2,
    ]  # fmt: skip
    every.resume(10**10, 7)
    assert every.chunks({"t": 11000, "speed": 1.0})[0].task == 8


def test_columns_by_position_are_refused() -> None:
    spec = SourceSpec("pump", {"v": ChannelSpec(1, "m")})
    with pytest.raises(UsageError, match="expected a name"):
        decoder(spec).check()
    decoder(spec).check(ordered=True)
    with pytest.raises(UsageError, match="'auto' holds for files"):
        decoder(SourceSpec("pump", {}, time=TimeSpec("t", "auto"))).check()
