"""A twin whose pose comes from scans: recorded, pushed, cut off and gone on; what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import reads
from evertwin.config.spec import ChannelSpec, ClockSpec, SourceSpec, StoreSpec, TimeSpec
from evertwin.errors import ConfigError, DataError
from evertwin.features.perception import PERCEIVED
from evertwin.fold import Chunk
from evertwin.rows import Feed
from evertwin.sources.spec import ArraySpec
from evertwin.worlds.live.recorder import main as record
from planted.draws import first_of
from planted.pushed import compared
from planted.twins import shipped

SECONDS = 40


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot whose scans get lost for three seconds; as tables and as a bag."""
    here = tmp_path_factory.mktemp("robot")
    for file in ("run.csv", "run.mcap"):
        record(["robot", "--seconds", str(SECONDS), "--record", str(here / file),
                "--order", "20:drop=1 for=3"])  # fmt: skip
    return here


def tables(folder: Path, *names: str) -> list[Path]:
    return [folder / f"run-{name}.csv" for name in names]


def with_wheels() -> TwinSpec:
    """The shipped twin, with wheels and gyro."""
    spec = shipped("robot_live")
    assert spec.perception is not None
    time = TimeSpec("t", "s")
    places = {f"wheel_{n}": ChannelSpec(n, u) for n, u in
              (("x", "m"), ("y", "m"), ("heading", "rad"))}  # fmt: skip
    odom = SourceSpec("odom", places, match="*odom*", time=time)
    imu = SourceSpec("imu", {"gyro": ChannelSpec("gyro", "rad/s")}, match="*imu*", time=time)
    rule = replace(spec.perception, wheels=tuple(places), gyro="gyro")
    return replace(spec, source=(*spec.source, odom, imu), perception=rule)


def truth(folder: Path) -> np.ndarray:
    return np.genfromtxt(folder / "run-pose.csv", delimiter=",", skip_header=1)[:, 2:5] * (
        0.01, 0.01, 1.0,
    )  # fmt: skip


@pytest.mark.parametrize("wheels", [False, True])
def test_the_pose_of_a_recorded_robot_is_where_it_was(folder: Path, wheels: bool) -> None:
    spec = with_wheels() if wheels else shipped("robot_live")
    names = ("command", "scan", *(("odom", "imu") if wheels else ()))
    with Twin(spec) as twin:
        result = twin.run(tables(folder, *names))
    measured = result.trace["measured"]
    off = measured - truth(folder)
    there = np.isfinite(off).all(axis=1)
    assert len(measured) == SECONDS and np.flatnonzero(~there).tolist() == [20, 21, 22]
    assert np.hypot(*off[there, :2].T).max() < 0.02 and np.abs(off[there, 2]).max() < 0.01
    told = [(e.kind, e.signal) for e in result.events if e.kind == "scans_missing"]
    assert told == [("scans_missing", "scan")]


@first_of("wheels", [True, False])
def test_pushed_is_recorded(folder: Path, wheels: bool) -> None:
    spec = with_wheels() if wheels else shipped("robot_live")
    names = ("command", "scan", *(("odom", "imu") if wheels else ()))
    found = compared(spec, tables(folder, *names), np.random.default_rng(1))
    assert found.different == () and found.pieces > 100


def test_a_bag_says_where_its_beams_look(folder: Path) -> None:
    spec = shipped("robot_live")
    assert spec.perception is not None
    command = SourceSpec(
        "command", {"v": ChannelSpec("/cmd_vel.linear.x", "m/s"),
                    "w": ChannelSpec("/cmd_vel.angular.z", "rad/s")},
        time=TimeSpec("/cmd_vel.logged", "ns"), slack=1.0,
    )  # fmt: skip
    bagged = replace(
        spec, source=(command,), array=(ArraySpec("scan", (180,), column="/scan.ranges"),),
        perception=replace(spec.perception, start=None, step=None),
    )  # fmt: skip
    with Twin(bagged) as twin, Twin(spec) as other:
        found = list(Feed(bagged, twin.model).stream(folder / "run.mcap"))
        known = list(Feed(spec, other.model).stream(tables(folder, "command", "scan")))
    one, two = (np.concatenate([block.y for block in blocks]) for blocks in (found, known))
    assert one == pytest.approx(two, abs=1e-9, nan_ok=True)


def pieces(spec: TwinSpec, folder: Path) -> Iterator[Chunk]:
    with Twin(spec) as twin:
        yield from Feed(spec, twin.model).chunks(tables(folder, "command", "scan", "odom", "imu"))


def test_a_twin_that_is_cut_off_goes_on(folder: Path, tmp_path: Path) -> None:
    spec = replace(with_wheels(), store=StoreSpec("twin.db"), folder=str(tmp_path))
    chunks = list(pieces(with_wheels(), folder))
    with Twin(replace(spec, store=StoreSpec("whole.db"))) as twin:
        for chunk in chunks:
            twin.push(chunk)
        whole = twin.finish()
    rests, falls = len(chunks) // 3, (len(chunks) // 3 + 7, len(chunks) // 2)
    twin = Twin(spec)
    for k, chunk in enumerate(chunks):
        if k == rests:
            twin.going().rest()  # a checkpoint; what follows is folded again
        if k in falls:
            twin.close()
            twin = Twin(spec)
        twin.push(chunk)
    result = twin.finish()
    twin.close()
    n = len(result.trace["measured"])
    assert n > 15, "the rows since it went on"
    for name in ("measured", "predicted", "t"):
        assert np.array_equal(result.trace[name], whole.trace[name][-n:], equal_nan=True)


def test_where_a_pose_is_given_none_is_made(folder: Path) -> None:
    t, told = np.arange(SECONDS) * 1.0, truth(folder)
    columns = dict(zip(("x", "y", "heading"), told.T, strict=True))
    command = np.genfromtxt(folder / "run-command.csv", delimiter=",", skip_header=1)
    with Twin(shipped("robot_live")) as twin:
        result = twin.run({"t": t, "v": 0.01 * command[:, 2], "w": command[:, 3], **columns})
    assert np.array_equal(result.trace["measured"], told)


HEAD = """schema = 1
name = "base"
model = { kind = "differential" }
[[source]]
name = "log"
channels = { v = { column = "v", unit = "m/s" }, w = { column = "w", unit = "rad/s" } }
[[array]]
name = "scan"
shape = [8]
column = "ranges"
time = "t"
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('scan = "lidar"', r":13: perception: scan: expected the name of an \[\[array\]\]"),
        ('scan = "scan"\nwheels = ["v", "w"]', "wheels: expected three channels"),
        ('scan = "scan"\nwheels = ["a", "b", "c"]', r"no \[\[source\]\] has the channels a, b, c"),
        ('scan = "scan"\ngyro = "g"', r"gyro: no \[\[source\]\] has the channels g"),
        ('scan = "scan"\nstep = 0', "step: expected the angle from beam to beam"),
        ('scan = "scan"\nstart = 0', "step: expected the angle from beam to beam"),
        ('scan = "scan"\nunit = "s"', "unit: expected one of length"),
        ('scan = "scan"\npose = ["x", "y"]', "pose: expected three names, got x, y"),
        ('scan = "scan"\n[clock]\nrate = 5', r"say \[clock\] gap"),
    ],
)
def test_what_is_wrong_in_a_twin_file_is_named(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        reads(f"{HEAD}[perception]\n{text}\n", "base.toml")


def test_what_lacks_is_named(tmp_path: Path, folder: Path) -> None:
    spec = shipped("robot_live")
    assert spec.perception is not None
    blind = replace(spec, perception=replace(spec.perception, start=None, step=None))
    with Twin(blind) as twin:
        with pytest.raises(ConfigError, match="do not say where their beams look: set start and"):
            twin.run(tables(folder, "command", "scan"))
        with pytest.raises(ConfigError, match="do not say where their beams look"):
            twin.push(Chunk("scan", np.array([0]), np.ones((1, 180))))
    with Twin(spec) as twin:
        with pytest.raises(ConfigError, match=r"none to scan.*give their recording too"):
            twin.run(tables(folder, "command"))
        with pytest.raises(DataError, match="expected 1 arrays of shape"):
            twin.push(Chunk("scan", np.array([0]), np.ones((1, 90))))
    other = replace(spec, array=(replace(spec.array[0], shape=(181,)),))
    with Twin(other) as twin, pytest.raises(DataError, match=r"ranges\.181"):
        twin.run(tables(folder, "command", "scan"))
    gap = replace(spec, clock=ClockSpec(rate=1.0, gap=1.1))
    with Twin(gap) as twin:
        rows = twin.run(tables(folder, "command", "scan")).trace["measured"]
    assert np.isnan(rows[20:23]).all() and np.isfinite(rows[24:]).all()


def test_ranges_in_another_unit(folder: Path, tmp_path: Path) -> None:
    spec = shipped("robot_live")
    assert spec.perception is not None
    table = np.genfromtxt(folder / "run-scan.csv", delimiter=",", skip_header=1)[:20]
    names = ",".join(["t", "seq", *(f"ranges.{k + 1}" for k in range(180))])
    table[:, 2:] *= 1000.0
    np.savetxt(tmp_path / "scan.csv", table, delimiter=",", header=names, comments="", fmt="%.10g")
    changes: list[Any] = [(spec, tables(folder, "command", "scan"))]
    milli = replace(spec, perception=replace(spec.perception, unit="mm"))
    changes.append((milli, [*tables(folder, "command"), tmp_path / "scan.csv"]))
    found = []
    for one, files in changes:
        with Twin(one) as twin:
            blocks = list(Feed(one, twin.model).stream(files))
        found.append(np.concatenate([block.y for block in blocks])[:9])
    assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_a_lidar_that_freezes_leaves_no_prediction_over_its_new_map(
    folder: Path, tmp_path: Path
) -> None:
    """Behind it the hall is another one: the same, mirrored."""
    head, *lines = (folder / "run-scan.csv").read_text().splitlines()
    scans = [line.split(",") for line in lines]
    begin, stop = len(scans) // 4, len(scans) * 3 // 4
    for k, one in enumerate(scans[begin:], begin):
        one[2:] = scans[begin][2:] if k < stop else [one[2], *one[:2:-1]]
    (tmp_path / "scan.csv").write_text("\n".join([head, *map(",".join, scans)]) + "\n")
    files, spec = [*tables(folder, "command"), tmp_path / "scan.csv"], shipped("robot_live")
    found = compared(spec, files, np.random.default_rng(2))
    assert all(one.startswith("log") for one in found.different), "which tells it, pushed"
    with Twin(spec) as twin:
        feed = Feed(spec, twin.model)
        rows = list(feed.stream(files))
    told = [e.kind for e in feed.events if e.kind in PERCEIVED]
    assert told == ["scans_frozen", "pose_lost", "scans_missing", "pose_found"]
    gap, y = (np.concatenate([getattr(block, n) for block in rows]) for n in ("gap", "y"))
    known = np.flatnonzero(np.isfinite(y[:, 0]))
    assert np.flatnonzero(gap).tolist() == [0, known[np.diff(known).argmax() + 1]]
    residual = found.result.trace["residual"][np.flatnonzero(gap)[1] :, :2]
    assert np.nanmax(np.abs(residual[:8])) < 0.1, "no prediction from one frame into another"
