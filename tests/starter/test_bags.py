"""Bags as robots record them: one source a topic, commands from one and the pose from another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from evertwin.config import read
from evertwin.machines.arm import Arm
from evertwin.machines.catalog import machine
from evertwin.starter import Draft, look, mapped

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
ROWS = 400


def header(stamp: int) -> Any:
    time = TYPES["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    return TYPES["std_msgs/msg/Header"](stamp=time, frame_id="odom")


def vector(x: float = 0.0, z: float = 0.0, kind: str = "Vector3") -> Any:
    return TYPES[f"geometry_msgs/msg/{kind}"](x=x, y=0.0, z=z)


def odometry(stamp: int, way: float, yaw: float, speed: float) -> Any:
    turn = TYPES["geometry_msgs/msg/Quaternion"](
        x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2))
    )
    place = TYPES["geometry_msgs/msg/Point"](x=way, y=0.1 * way**2, z=0.0)
    pose = TYPES["geometry_msgs/msg/Pose"](position=place, orientation=turn)
    twist = TYPES["geometry_msgs/msg/Twist"](linear=vector(speed), angular=vector(0.0, 0.1 * speed))
    none = np.zeros(36)
    return TYPES["nav_msgs/msg/Odometry"](
        header(stamp), "base",
        TYPES["geometry_msgs/msg/PoseWithCovariance"](pose, none),
        TYPES["geometry_msgs/msg/TwistWithCovariance"](twist, none),
    )  # fmt: skip


def test_commands_and_odometry_become_two_sources(tmp_path: Path) -> None:
    with Writer(tmp_path / "drive", version=9) as writer:
        link = {
            topic: writer.add_connection(topic, f"{kind}", typestore=STORE)
            for topic, kind in (
                ("/cmd_vel", "geometry_msgs/msg/Twist"), ("/odom", "nav_msgs/msg/Odometry")
            )
        }  # fmt: skip
        for i in range(ROWS):
            stamp, speed = 10**9 + i * 50_000_000, float(np.sin(0.05 * i))
            told = TYPES["geometry_msgs/msg/Twist"](vector(speed), vector(0.0, 0.1 * speed))
            kinds = {"/cmd_vel": told, "/odom": odometry(stamp, 0.01 * i, 0.001 * i, 0.9 * speed)}
            for topic, message in kinds.items():
                bytes_ = STORE.serialize_cdr(message, message.__msgtype__)
                writer.write(link[topic], stamp, bytes_)
    model = machine("differential", {})
    seen, _ = look([tmp_path / "drive"])
    found = mapped(model, seen)
    assert {m.channel: m.column for m in found.matches} == {
        "v": "/cmd_vel.linear.x", "w": "/cmd_vel.angular.z", "x": "/odom.pose.pose.position.x",
        "y": "/odom.pose.pose.position.y", "heading": "/odom.pose.pose.orientation.yaw",
    }  # fmt: skip
    out = tmp_path / "base.toml"
    out.write_text(Draft(out, "differential", {}, model, seen, found).text())
    assert [source.name for source in read(out).source] == ["cmd_vel", "odom"]


def test_joints_go_by_their_names_not_their_order(tmp_path: Path) -> None:
    model = machine("arm", {"urdf": "ur5_like"})
    assert isinstance(model, Arm)
    names = sorted(model.chain.joints)
    kind = "sensor_msgs/msg/JointState"
    with Writer(tmp_path / "arm", version=9) as writer:
        link = writer.add_connection("/joint_states", kind, typestore=STORE)
        for i in range(ROWS):
            stamp, phase = 10**9 + i * 10_000_000, 0.01 * i + np.arange(6)
            told = (np.sin(phase), np.cos(phase), 3 * np.sign(np.cos(phase)))
            message = TYPES[kind](header(stamp), names, *told)
            writer.write(link, stamp, STORE.serialize_cdr(message, kind))
    found = mapped(model, look([tmp_path / "arm"])[0])
    columns = {m.channel: m.column for m in found.matches}
    for j, joint in enumerate(model.chain.joints):
        assert columns[f"q{j + 1}"] == f"/joint_states.position.{joint}"
        assert columns[f"tau{j + 1}"] == f"/joint_states.effort.{joint}"
    assert not found.questions


def transform(stamp: int, parent: str, child: str, x: float, yaw: float) -> Any:
    head = header(stamp)
    head.frame_id = parent
    turn = TYPES["geometry_msgs/msg/Quaternion"](
        x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2))
    )
    moved = TYPES["geometry_msgs/msg/Transform"](vector(x), turn)
    return TYPES["tf2_msgs/msg/TFMessage"](
        [TYPES["geometry_msgs/msg/TransformStamped"](head, child, moved)]
    )


def test_neither_what_a_twin_says_nor_a_frame_of_reference_is_the_machine(tmp_path: Path) -> None:
    kinds = {"/cmd_vel": "geometry_msgs/msg/Twist", "/tf": "tf2_msgs/msg/TFMessage",
             "/evertwin/base/prediction": "nav_msgs/msg/Odometry",
             "/state": "diagnostic_msgs/msg/DiagnosticStatus"}  # fmt: skip
    with Writer(tmp_path / "drive", version=9) as writer:
        link = {t: writer.add_connection(t, k, typestore=STORE) for t, k in kinds.items()}
        for i in range(ROWS):
            stamp, speed = 10**9 + i * 50_000_000, float(np.sin(0.05 * i))
            said = (
                ("/cmd_vel", TYPES["geometry_msgs/msg/Twist"](vector(speed), vector(0.0, speed))),
                ("/tf", transform(stamp, "odom", "base_link", 0.01 * i, 0.001 * i)),
                ("/tf", transform(stamp, "map", "odom", 0.5, 0.1)),
                ("/evertwin/base/prediction", odometry(stamp, 0.01 * i, 0.001 * i, speed)),
                ("/state", TYPES[kinds["/state"]](level=1, name="", message="", hardware_id="",
                                                  values=[])),
            )  # fmt: skip
            for topic, message in said:
                writer.write(link[topic], stamp, STORE.serialize_cdr(message, message.__msgtype__))
    seen, told = look([tmp_path / "drive"])
    found = {m.channel: m.column for m in mapped(machine("differential", {}), seen).matches}
    assert found["x"] == "/tf.transforms.base_link.transform.translation.x"
    assert found["heading"] == "/tf.transforms.base_link.transform.rotation.yaw"
    tables = {table.name: table for table in told[0].tables}
    # each message of /tf places one of two frames; constants of a type are no fields
    placed = {c.name: c.missing for c in tables["/tf"].columns if c.name.endswith("translation.x")}
    assert placed == {"/tf.transforms.base_link.transform.translation.x": ROWS,
                      "/tf.transforms.odom.transform.translation.x": ROWS}  # fmt: skip
    names = {column.name for column in tables["/state"].columns}
    assert names == {"/state.level", "/state.logged"}
