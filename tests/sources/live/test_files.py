"""Files that grow, and recordings replayed as if live."""

from __future__ import annotations

import asyncio
import re
import threading
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.fold import Chunk
from evertwin.sources.live import Around, LiveSource, check_live, open_live, settings_of
from evertwin.sources.live.registry import read_settings
from evertwin.sources.recorded import Recorded
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec

SPEC = SourceSpec("log", {"v": ChannelSpec("v", "cm/s")}, time=TimeSpec("t"))


def growing(path: Path) -> LiveSource:
    table = {"source": "log", "protocol": "file", "path": path.name, "look": "10 ms"}
    return open_live(table, SPEC, Around(path.parent))


def replay(files: tuple[str, ...], speed: float, around: Around, name: str = "log") -> LiveSource:
    spec = SourceSpec(name, SPEC.channels, files, time=SPEC.time)
    return open_live({"source": name, "protocol": "replay", "speed": speed}, spec, around)


def seen(chunks: list[Chunk]) -> list[int]:
    return [round(float(v) * 100) for chunk in chunks for v in chunk.v[:, 0]]


def test_a_file_is_read_as_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"

    source = growing(path)

    def until(received: int) -> None:
        end = time.monotonic() + 10.0
        while source.health.received < received and time.monotonic() < end:
            time.sleep(0.005)

    def write() -> None:
        time.sleep(0.05)  # absent at first
        with path.open("a") as file:
            for part in ("t,v\n0,0\n1,", "1\n2,2", "\n3\n", "x,4\n4,4\n"):
                file.write(part)
                file.flush()
                time.sleep(0.02)
        until(4)
        path.rename(tmp_path / "run.1")  # rotation by name
        path.write_text("t,v\n5,5\n6,6\n7,half")
        until(6)
        path.write_text("t,v\n6,6\n8,8\n9,9\n")  # cut and written anew
        until(8)
        with path.open("a") as file:
            file.write("10,10\n")

    writer = threading.Thread(target=write)
    writer.start()
    chunks = check_live(source, limit=9)
    writer.join()
    assert seen(chunks) == [0, 1, 2, 4, 5, 6, 8, 9, 10]
    health = source.health
    assert health.rejected == {"a line with another number of cells": 1, "no stamp": 1,
                               "a line without its end": 1}  # fmt: skip
    assert health.repeated == 1 and health.noted == {
        "the file was replaced": 1, "the file was cut": 1,
    }  # fmt: skip


def test_a_file_goes_on_where_the_store_ended(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t;v\n" + "".join(f"{i};{i},5\n" for i in range(100)))
    source = growing(path)
    source.resume(96 * 10**9)
    assert [chunk.t[0] // 10**9 for chunk in check_live(source, limit=3)] == [97, 98, 99]


def test_a_table_without_the_column_is_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "run.csv").write_text("t,w\n0,1\n")
    source = growing(tmp_path / "run.csv")
    assert check_live(source, seconds=1.0) == []
    assert "no column 'v'; there are t, w" in source.health.reason
    assert len(caplog.records) == 1


def test_a_file_needs_stamps(tmp_path: Path) -> None:
    source = open_live(settings_of("file")("log", "file", stamp="arrival"), SPEC)
    with pytest.raises(UsageError, match="a column of time"):
        source.open()


def test_a_replay_gives_what_a_run_reads(tmp_path: Path) -> None:
    for part in range(2):
        rows = (f"{i / 50},{i}\n" for i in range(1000))
        (tmp_path / f"part{part}.csv").write_text("t,v\n" + "".join(rows))
    source = replay(("part*.csv",), float("inf"), Around(tmp_path))
    live = check_live(source, limit=10**6)
    spec = SourceSpec("log", SPEC.channels, time=SPEC.time)
    run = list(Recorded.of(spec, tuple(sorted(tmp_path.iterdir()))).read())
    for one in ("t", "v"):
        parts = ([getattr(c, one) for c in chunks] for chunks in (live, run))
        first, second = map(np.concatenate, parts)
        assert first.tobytes() == second.tobytes()
    assert {c.task for c in live} == {0, 1}
    again = replay(("part*.csv",), float("inf"), Around(tmp_path))
    again.resume(int(live[-3].t[-1]), 1)
    rest = check_live(again, limit=10**6)
    assert sum(len(c.t) for c in rest) == sum(len(c.t) for c in live[-2:])


@pytest.mark.parametrize("speed", [20.0, float("inf")])
def test_replayed_sources_keep_step(tmp_path: Path, speed: float) -> None:
    (tmp_path / "a.csv").write_text("t,v\n" + "".join(f"{i / 10},{i}\n" for i in range(101)))
    (tmp_path / "b.csv").write_text("t,v\n" + "".join(f"{5 + i / 100},{i}\n" for i in range(501)))
    around = Around(tmp_path)
    sources = [replay((f"{name}.csv",), speed, around, name) for name in "ab"]
    came: list[tuple[int, str]] = []

    async def read(source: LiveSource) -> None:
        async for chunk in source.chunks():
            came.extend((int(t), source.name) for t in chunk.t)

    async def all_of_them() -> float:
        for source in sources:
            source.open()
        began = time.monotonic()
        await asyncio.gather(*map(read, sources))
        return time.monotonic() - began

    took = asyncio.run(all_of_them())
    newest = {"a": 0, "b": 0}
    for stamp, name in came:
        newest[name] = stamp
        assert newest["b"] == 0 or abs(newest["a"] - newest["b"]) <= 2.1e9
    assert len(came) == 602
    if np.isfinite(speed):
        assert 0.4 <= took < 30.0


def test_a_replay_without_files_says_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        replay(("absent.csv",), 1.0, Around(tmp_path)).open()
    with pytest.raises(DataError, match="name them"):
        replay((), 1.0, Around(tmp_path)).open()


def test_an_unknown_protocol_is_said_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="did you mean 'replay'"):
        settings_of("repla")
    with pytest.raises(ConfigError, match="spead"):
        open_live({"source": "log", "protocol": "replay", "spead": 1}, SPEC)


def test_the_how_to_says_what_is_read() -> None:
    page = Path(__file__).parents[3] / "docs" / "how-to" / "connect-a-machine.md"
    blocks = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    tables = [tomllib.loads(block)["twin"]["source"][0] for block in blocks]
    read = [read_settings(table).protocol for table in tables]
    assert read == ["modbus", "mqtt", "opcua", "ros", "file"]
