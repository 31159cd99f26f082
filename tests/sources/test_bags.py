"""ROS 1 and ROS 2 bags, written by rosbags, read without an index and without metadata."""

from __future__ import annotations

import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
import zstandard
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from evertwin.errors import DataError
from evertwin.sources import Cell, Clock, Recorded, inspect, open_recording

N = 60
STEP = 20_000_000
START = 1_614_859_007 * 10**9


def odometry(types: dict, i: int, ros1: bool) -> object:
    stamp = START + i * STEP
    time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    seq = {"seq": i} if ros1 else {}
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="odom", **seq)
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    angle = 0.02 * i
    turn = types["geometry_msgs/msg/Quaternion"](
        x=0.0, y=0.0, z=float(np.sin(angle / 2)), w=float(np.cos(angle / 2))
    )
    pose = types["geometry_msgs/msg/Pose"](
        position=point(x=0.1 * i, y=0.0, z=0.0), orientation=turn
    )
    twist = types["geometry_msgs/msg/Twist"](
        linear=vector(x=0.5, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=1.0)
    )
    full = np.zeros(36)
    return types["nav_msgs/msg/Odometry"](
        header=header, child_frame_id="base",
        pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=full),
        twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=full),
    )  # fmt: skip


def joints(types: dict, i: int, ros1: bool) -> object:
    header = odometry(types, i, ros1).header  # type: ignore[attr-defined]
    return types["sensor_msgs/msg/JointState"](
        header=header, name=["shoulder", "elbow"], position=np.array([0.1 * i, -0.1 * i]),
        velocity=np.array([1.0, 2.0]), effort=np.zeros(0),
    )  # fmt: skip


def ros1_bag(path: Path, compression: str = "") -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer1(path)
    writer.chunk_threshold = 4000
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression])
    with writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        arm = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        word = writer.add_connection("/say", "std_msgs/msg/String", typestore=store)
        for i in range(N):
            t = START + i * STEP + 5_000_000
            for link, make, name in (
                (odom, odometry, "nav_msgs/msg/Odometry"),
                (arm, joints, "sensor_msgs/msg/JointState"),
            ):
                writer.write(link, t, store.serialize_ros1(make(store.types, i, True), name))
            text = store.types["std_msgs/msg/String"](data="hello")
            writer.write(word, t, store.serialize_ros1(text, "std_msgs/msg/String"))
    return path


def ros2_bag(path: Path, storage: StoragePlugin) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 torque\nint32[3] code", "my_msgs/msg/Gauge"))
    with Writer2(path, version=9, storage_plugin=storage) as writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        arm = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        own = writer.add_connection("/gauge", "my_msgs/msg/Gauge", typestore=store)
        for i in range(N):
            t = START + i * STEP + 5_000_000
            for link, make, name in (
                (odom, odometry, "nav_msgs/msg/Odometry"),
                (arm, joints, "sensor_msgs/msg/JointState"),
            ):
                writer.write(link, t, store.serialize_cdr(make(store.types, i, False), name))
            gauge = store.types["my_msgs/msg/Gauge"](torque=1.5, code=np.arange(3, dtype=np.int32))
            writer.write(own, t, store.serialize_cdr(gauge, "my_msgs/msg/Gauge"))
    return path


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bags")
    db3 = ros2_bag(folder / "db3", StoragePlugin.SQLITE3)
    mcap = ros2_bag(folder / "mcap", StoragePlugin.MCAP)
    return {
        "ros1": ros1_bag(folder / "plain.bag"),
        "ros1_bz2": ros1_bag(folder / "bz2.bag", "BZ2"),
        "ros1_lz4": ros1_bag(folder / "lz4.bag", "LZ4"),
        "db3_folder": db3,
        "db3_file": next(db3.glob("*.db3")),
        "mcap_folder": mcap,
        "mcap_file": next(mcap.glob("*.mcap")),
    }


KINDS = ["ros1", "ros1_bz2", "ros1_lz4", "db3_folder", "db3_file", "mcap_folder", "mcap_file"]


@pytest.mark.parametrize("kind", KINDS)
def test_standard_messages(kind: str, bags: dict[str, Path]) -> None:
    recording = open_recording(bags[kind])
    cells = (
        Cell("x", "/odom.pose.pose.position.x", "m"),
        Cell("yaw", "/odom.pose.pose.orientation.yaw", "rad"),
        Cell("w", "/odom.twist.twist.angular.z", "rad/s"),
    )
    chunks = list(Recorded("odom", (bags[kind],), cells).read())
    t, v = np.concatenate([c.t for c in chunks]), np.concatenate([c.v for c in chunks])
    assert t.tolist() == [START + i * STEP for i in range(N)]
    np.testing.assert_allclose(v[:, 0], 0.1 * np.arange(N))
    np.testing.assert_allclose(v[:, 1], 0.02 * np.arange(N), atol=1e-12)
    assert not any("covariance" in c.name for t in recording.tables for c in t.columns)


@pytest.mark.parametrize("kind", KINDS)
def test_joints_by_name_and_logged_time(kind: str, bags: dict[str, Path]) -> None:
    clock = Clock("/joint_states.logged")
    cells = (Cell("q2", "/joint_states.position.elbow", "rad"),)
    chunk = next(Recorded("arm", (bags[kind],), cells, clock).read())
    assert chunk.t[0] == START + 5_000_000 and chunk.v[3, 0] == pytest.approx(-0.3)


def test_types_that_a_bag_defines_itself(bags: dict[str, Path]) -> None:
    chunk = next(Recorded("g", (bags["mcap_file"],), (Cell("tau", "/gauge.torque", "Nm"),)).read())
    assert chunk.v[0, 0] == 1.5
    notes = open_recording(bags["db3_file"]).notes
    assert any("/gauge" in note and "definition" in note for note in notes)


def test_columns_of_two_topics_are_refused(bags: dict[str, Path]) -> None:
    cells = (
        Cell("x", "/odom.pose.pose.position.x", "m"),
        Cell("q", "/joint_states.velocity.elbow", "1"),
    )
    with pytest.raises(DataError, match="source of its own"):
        Recorded("both", (bags["ros1"],), cells).open()


def test_nearest_column_is_named(bags: dict[str, Path]) -> None:
    with pytest.raises(DataError, match=r"did you mean '/odom\.pose\.pose\.position\.x'"):
        Recorded("o", (bags["ros1"],), (Cell("x", "/odom.pose.position.x", "m"),)).open()


@pytest.mark.parametrize("kind", ["ros1", "ros1_lz4", "ros1_bz2"])
def test_cut_at_any_offset_recovers_what_lies_before(
    kind: str, bags: dict[str, Path], tmp_path: Path
) -> None:
    whole = bags[kind].read_bytes()
    rng = np.random.default_rng(3)
    column = "/odom.pose.pose.position.x"
    last = 0
    for share in sorted(rng.uniform(0.02, 1.0, 12)):
        path = tmp_path / f"cut{bags[kind].suffix}"
        path.write_bytes(whole[: int(len(whole) * share)])
        source = Recorded("o", (path,), (Cell("x", column, "m"),))
        try:
            rows = np.concatenate([c.v for c in source.read()])[:, 0]
        except DataError:
            assert last == 0
            continue
        np.testing.assert_allclose(rows, 0.1 * np.arange(len(rows)))
        assert len(rows) >= last
        last = len(rows)
        if len(rows) < N:
            assert source.tally.counts == {"cut_off": 1}
    assert last > 0


def test_damage_anywhere_never_gives_a_wrong_number(bags: dict[str, Path], tmp_path: Path) -> None:
    whole = bags["mcap_file"].read_bytes()
    for at in np.random.default_rng(4).integers(8, len(whole) - 8, 60).tolist():
        path = tmp_path / "damaged.mcap"
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x5A]) + whole[at + 1 :])
        source = Recorded("o", (path,), (Cell("x", "/odom.pose.pose.position.x", "m"),))
        try:
            chunks = list(source.read())
        except DataError:
            continue
        for chunk in chunks:
            np.testing.assert_allclose(chunk.v[:, 0], 0.1 * (chunk.t - START) / STEP)


def test_split_bags_are_read_in_order(tmp_path: Path) -> None:
    """Files run_2 and run_10 of one bag, and one whose last rows are still in its log."""
    folder = tmp_path / "bag"
    folder.mkdir()
    links = []
    for part, numbers in ((2, range(3)), (10, range(3, 6))):
        link = sqlite3.connect(folder / f"run_{part}.db3")
        link.execute("PRAGMA journal_mode=WAL")
        link.execute(
            "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
        )
        link.execute(
            "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"
        )
        link.execute("INSERT INTO topics VALUES(1, '/x', 'std_msgs/msg/Float64', 'cdr')")
        for i in numbers:
            data = b"\0\1\0\0" + struct.pack("<d", i)
            link.execute("INSERT INTO messages VALUES(?,1,?,?)", (i, i * STEP, data))
        link.commit()
        links.append(link)
    assert (folder / "run_2.db3-wal").stat().st_size > 0
    (chunk,) = [
        c for c in Recorded("x", (folder,), (Cell("x", "/x.data", "1"),)).read() if len(c.t)
    ]
    assert chunk.v[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    for link in links:
        link.close()


def test_info_names_what_is_left_out(bags: dict[str, Path]) -> None:
    info = inspect(bags["ros1"])
    assert {t.name for t in info.tables} == {"/odom", "/joint_states"}
    assert any("/say" in finding for finding in info.findings)
    time = info.tables[0].time
    assert time is not None and round(time.rate) == 50


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_messages_that_were_packed_one_by_one_are_read(
    tmp_path: Path, plugin: StoragePlugin
) -> None:
    kind = "geometry_msgs/msg/Twist"
    rng, store = np.random.default_rng(4), get_typestore(Stores.ROS2_HUMBLE)
    speeds = rng.normal(size=300)
    writer = Writer2(tmp_path / "run", version=9, storage_plugin=plugin)
    if plugin is StoragePlugin.SQLITE3:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        link = writer.add_connection("/cmd_vel", kind, typestore=store)
        vector = store.types["geometry_msgs/msg/Vector3"]
        for i, speed in enumerate(speeds):
            told = store.types[kind](vector(x=speed, y=0.0, z=0.0), vector(x=0.0, y=0.0, z=speed))
            data = bytes(store.serialize_cdr(told, kind))
            packed = zstandard.compress(data) if plugin is StoragePlugin.MCAP else data
            writer.write(link, 10**9 * (i + 1), packed)
    recording = open_recording(tmp_path / "run")
    table = recording.tables[0]
    rows = next(iter(table.rows(["/cmd_vel.linear.x", "/cmd_vel.angular.z"], None)))
    assert not recording.notes and not rows.problems
    assert np.array_equal(rows.values, np.stack([speeds, speeds], axis=1))


def test_a_bag_that_grew_is_read_anew(tmp_path: Path) -> None:
    file = tmp_path / "run.bag"
    for seed in range(20):
        count = int(np.random.default_rng(seed).integers(5, 60))
        file.unlink(missing_ok=True)
        with Writer1(file) as writer:
            store = get_typestore(Stores.ROS1_NOETIC)
            link = writer.add_connection("/v", "std_msgs/msg/Float64", typestore=store)
            for i in range(count):
                told = store.types["std_msgs/msg/Float64"](1.0 * i)
                data = store.serialize_ros1(told, link.msgtype)
                writer.write(link, 10**9 * (i + 1), data)
        table = open_recording(file).tables[0]
        for _ in range(2):  # kept the second time
            assert sum(len(rows.line) for rows in table.rows(["/v.data"], "/v.logged")) == count
