"""Scans, odometry and gyro of bags: ROS 1, ROS 2 and MCAP alike, and what is wrong with them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from evertwin.errors import DataError, UsageError
from evertwin.sources import inspect, open_recording
from evertwin.sources.columns.scans import Scans
from evertwin.sources.robot_logs.bag_scans import scans_of

START, PERIOD, N, BEAMS = 1_614_859_007 * 10**9, 100_000_000, 12, 10
TF = """geometry_msgs/TransformStamped[] transforms"""
KINDS = ["ros1", "sqlite3", "mcap"]


class Said(NamedTuple):
    """A message: topic, when it was logged, type, and how it is made of the types."""

    topic: str
    logged: int
    type: str
    make: Callable[[Any], Any]


class Making:
    """Messages of one bag."""

    def __init__(self, kind: str) -> None:
        self.ros1 = kind == "ros1"
        self.kind = kind
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        if self.ros1:
            self.store.register(get_types_from_msg(TF, "tf2_msgs/msg/TFMessage"))
        self.types = self.store.types

    def header(self, t: int, frame: str) -> Any:
        time = self.types["builtin_interfaces/msg/Time"](sec=t // 10**9, nanosec=t % 10**9)
        seq = {"seq": 0} if self.ros1 else {}
        return self.types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **seq)

    def scan(self, t: int, ranges: np.ndarray, **more: float) -> Said:
        numbers = {
            "angle_min": -0.5, "angle_max": 0.4, "angle_increment": 0.1, "time_increment": 0.001,
            "scan_time": 0.1, "range_min": 0.1, "range_max": 30.0,
        } | more  # fmt: skip
        made = self.types["sensor_msgs/msg/LaserScan"](
            header=self.header(t, "laser"), ranges=ranges.astype(np.float32),
            intensities=np.zeros(0, np.float32), **numbers,
        )  # fmt: skip
        return Said("/scan", t + 5, "sensor_msgs/msg/LaserScan", lambda _: made)

    def vector(self, kind: str, x: float, y: float, z: float) -> Any:
        return self.types[f"geometry_msgs/msg/{kind}"](x=x, y=y, z=z)

    def turn(self, roll: float, yaw: float) -> Any:
        cr, sr, cy, sy = (f(a / 2) for a in (roll, yaw) for f in (math.cos, math.sin))
        return self.types["geometry_msgs/msg/Quaternion"](
            x=cy * sr, y=sy * sr, z=sy * cr, w=cy * cr
        )

    def odometry(self, t: int, pose: tuple[float, float, float], topic: str, frame: str) -> Said:
        types = self.types
        at = types["geometry_msgs/msg/Pose"](
            position=self.vector("Point", pose[0], pose[1], 0.0),
            orientation=self.turn(0.0, pose[2]),
        )
        twist = types["geometry_msgs/msg/Twist"](
            linear=self.vector("Vector3", 1.0, 0.0, 0.0),
            angular=self.vector("Vector3", 0.0, 0.0, 0.0),
        )
        full = np.zeros(36)
        made = types["nav_msgs/msg/Odometry"](
            header=self.header(t, frame), child_frame_id="base_link",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=at, covariance=full),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=full),
        )  # fmt: skip
        return Said(topic, t + 7, "nav_msgs/msg/Odometry", lambda _: made)

    def imu(self, t: int, rate: float) -> Said:
        nine = np.zeros(9)
        made = self.types["sensor_msgs/msg/Imu"](
            header=self.header(t, "imu_link"), orientation=self.turn(0.0, 0.0),
            orientation_covariance=nine, angular_velocity=self.vector("Vector3", 0.0, 0.0, rate),
            angular_velocity_covariance=nine,
            linear_acceleration=self.vector("Vector3", 0.0, 0.0, 9.8),
            linear_acceleration_covariance=nine,
        )  # fmt: skip
        return Said("/imu", t, "sensor_msgs/msg/Imu", lambda _: made)

    def placed(
        self, child: str, place: tuple[float, float, float], roll: float, yaw: float
    ) -> Said:
        types = self.types
        made = types["tf2_msgs/msg/TFMessage"](transforms=[
            types["geometry_msgs/msg/TransformStamped"](
                header=self.header(START, "base_link"), child_frame_id=child,
                transform=types["geometry_msgs/msg/Transform"](
                    translation=self.vector("Vector3", *place), rotation=self.turn(roll, yaw)
                ),
            )
        ])  # fmt: skip
        return Said("/tf_static", START, "tf2_msgs/msg/TFMessage", lambda _: made)

    def write(self, path: Path, said: list[Said]) -> Path:
        with self._writer(path) as writer:
            links: dict[str, Any] = {}
            for topic, logged, type_, make in said:
                if topic not in links:
                    links[topic] = writer.add_connection(topic, type_, typestore=self.store)
                pack = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
                writer.write(links[topic], logged, pack(make(self.types), type_))
        return path

    def _writer(self, path: Path) -> Any:
        if self.ros1:
            return Writer1(path)
        return Writer2(path, version=9, storage_plugin=StoragePlugin[self.kind.upper()])


def ranges(i: int) -> np.ndarray:
    return 2.0 + 0.1 * np.arange(BEAMS) + 0.01 * i


def usual(making: Making) -> list[Said]:
    """A drive along x, 0.1 m from scan to scan, odometry at twice the rate of the scans."""
    said = [making.placed("laser", (0.3, 0.1, 0.2), 0.0, 0.5)]
    for i in range(N):
        t = START + i * PERIOD
        said.append(making.scan(t, ranges(i)))
        for half in (0, 1):
            at = t + half * PERIOD // 2
            pose = (0.1 * i + 0.05 * half, 0.0, 0.0)
            said.append(making.odometry(at, pose, "/odom", "odom"))
            said.append(making.imu(at, 0.01 * i))
    return said


def only(path: Path, scan: str = "", odometry: str = "") -> Scans:
    (scans,) = scans_of(open_recording(path), scan, odometry)
    return scans


@pytest.mark.parametrize("kind", KINDS)
def test_scans_with_what_moves_them(kind: str, tmp_path: Path) -> None:
    making = Making(kind)
    path = making.write(tmp_path / "run.bag", usual(making))
    scans = only(path)
    assert scans.name == "/scan" and scans.t.tolist() == [START + i * PERIOD for i in range(N)]
    np.testing.assert_allclose(scans.ranges[3], ranges(3), rtol=1e-6)
    assert scans.lidar.mount == pytest.approx((0.3, 0.1, 0.5)) and scans.lidar.longest == 30.0
    assert (scans.lidar.start, scans.lidar.step) == pytest.approx((-0.5, 0.1))
    assert scans.wheels is not None and scans.gyro is not None and scans.odometry is not None
    assert scans.wheels.name == "/odom" and len(scans.wheels.t) == 2 * N
    assert scans.odometry[3, 0] == pytest.approx(0.3) and scans.arrived is not None
    assert scans.gyro.values[:, 0] == pytest.approx(0.01 * np.repeat(np.arange(N), 2))
    info = inspect(path).scans[0]
    assert (info.count, info.beams, info.odometry) == (N, BEAMS, True)
    assert info.rate == pytest.approx(10.0) and info.farthest == pytest.approx(3.01)


def test_a_gyro_that_never_changes_is_not_used(tmp_path: Path) -> None:
    making = Making("mcap")
    said = [making.scan(START + i * PERIOD, ranges(i)) for i in range(5)]
    said += [making.imu(START + i * PERIOD, 0.0) for i in range(5)]
    scans = only(making.write(tmp_path / "a", said))
    assert scans.gyro is None and "always says the same" in " ".join(scans.findings)


def test_a_lidar_that_hangs_and_one_that_is_tilted(tmp_path: Path) -> None:
    making = Making("mcap")
    said = usual(making)
    said[0] = making.placed("laser", (0.0, 0.0, 1.0), math.pi, 0.0)
    scans = only(making.write(tmp_path / "a", said))
    assert (scans.lidar.start, scans.lidar.step) == pytest.approx((0.5, -0.1))
    assert any("upside down" in line for line in scans.findings)
    said[0] = making.placed("laser", (0.0, 0.0, 1.0), 0.5, 0.0)
    with pytest.raises(DataError, match="tilted by 29°"):
        only(making.write(tmp_path / "b", said))
    scans = only(making.write(tmp_path / "c", said[1:]))
    assert any("does not place 'laser'" in line for line in scans.findings)


def test_odometry_that_is_the_reference_is_not_used(tmp_path: Path) -> None:
    making = Making("sqlite3")
    more = [making.odometry(START + i * PERIOD, (0.1 * i + 4.0, 1.0, 0.0), "/truth", "world")
            for i in range(N)]  # fmt: skip
    path = making.write(tmp_path / "a", [*usual(making), *more])
    scans = only(path)
    assert scans.odometry is None and scans.wheels is None and scans.stated is not None
    assert scans.stated[2, 0] == pytest.approx(4.2)
    assert any("odometry /odom equals /truth" in line for line in inspect(path).findings)


def test_scans_out_of_order_repeated_and_with_wrong_stamps(tmp_path: Path) -> None:
    making = Making("mcap")
    said = [making.scan(START + i * PERIOD, ranges(i)) for i in (0, 1, 3, 2, 4, 5, 5, 6, 7)]
    wrong = making.scan(0, ranges(8))
    said.append(wrong._replace(logged=START + 8 * PERIOD + 5))
    scans = only(making.write(tmp_path / "a", said))
    assert scans.t.tolist() == [START + i * PERIOD for i in range(9)]
    np.testing.assert_allclose(scans.ranges[:, 0], 2.0 + 0.01 * np.arange(9), rtol=1e-6)
    text = " ".join(scans.findings)
    assert "1 of 10 scans came out of order, by up to 0.1 s" in text
    assert "1 of 10 scans repeat" in text and "1 of 10 stamps are absent" in text
    assert scans.odometry is None


def test_ranges_that_are_none(tmp_path: Path) -> None:
    making = Making("mcap")
    values = np.array([0.0, 0.05, math.nan, math.inf, -math.inf, 30.0, 31.0, -1.0, 2.0, 3.0])
    scans = only(making.write(tmp_path / "a", [making.scan(START + i, values) for i in range(5)]))
    assert np.flatnonzero(np.isfinite(scans.ranges[0])).tolist() == [8, 9]


def test_scans_of_uneven_beams_are_put_on_one_grid(tmp_path: Path) -> None:
    making = Making("mcap")
    said = [making.scan(START + i * PERIOD, ranges(i)) for i in range(4)]
    said.append(making.scan(START + 4 * PERIOD, np.arange(1.0, 13.0), angle_min=-0.6))
    scans = only(making.write(tmp_path / "a", said))
    assert scans.ranges[4].tolist() == list(range(2, 12))
    assert "1 of 5 scans have not 10 beams" in " ".join(scans.findings)


def test_a_named_topic_and_one_that_is_not_there(tmp_path: Path) -> None:
    making = Making("mcap")
    said = usual(making) + [making.scan(START + i, 2 * ranges(i))._replace(topic="/back")
                            for i in range(3)]  # fmt: skip
    path = making.write(tmp_path / "a", said)
    assert [one.name for one in scans_of(open_recording(path))] == ["/scan", "/back"]
    assert len(only(path, "/back").t) == 3
    assert only(path, "/scan", "/odom").wheels is not None
    for names in (("/bak",), ("", "/wheel")):
        with pytest.raises(UsageError, match=r"did you mean|there is"):
            scans_of(open_recording(path), *names)
    assert replace(only(path, "/back"), findings=()).timed


def test_stamps_that_never_change_give_way_to_the_times_of_logging(tmp_path: Path) -> None:
    """Long before the logging: they are no clock that the times of logging could be put on."""
    making = Making("ros1")
    said = []
    for i in range(9):
        one = making.scan(START - 25 * 10**9, ranges(i))
        said.append(one._replace(logged=START + i * PERIOD))
    scans = only(making.write(tmp_path / "a.bag", said))
    assert scans.t.tolist() == [START + i * PERIOD for i in range(9)]
    assert "the times of logging are used" in " ".join(scans.findings)


def test_a_gyro_that_says_no_number_is_not_taken_to_stand(tmp_path: Path) -> None:
    making = Making("mcap")
    said = [making.scan(START + i * PERIOD, ranges(i)) for i in range(6)]
    rates = [0.1, 0.2, math.nan, math.nan, 0.3, 0.4]
    said += [making.imu(START + i * PERIOD, rate) for i, rate in enumerate(rates)]
    gyro = only(making.write(tmp_path / "a", said)).gyro
    assert gyro is not None and gyro.values[:, 0].tolist() == [0.1, 0.2, 0.3, 0.4]


def test_members_that_nobody_fills_are_no_findings(tmp_path: Path) -> None:
    making = Making("mcap")
    said = [making.scan(START + i * PERIOD, ranges(i)) for i in range(6)]
    said += [making.imu(START + i * PERIOD, 0.1 + 0.01 * i) for i in range(6)]
    assert not [x for x in inspect(making.write(tmp_path / "a", said)).findings if "const" in x]
    still = [making.imu(START + i * PERIOD, 0.1) for i in range(6)]
    assert [x for x in inspect(making.write(tmp_path / "b", still)).findings if "const" in x]
