"""What a twin says at a real ROS 1 master, recorded by Debian's rosbag."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evertwin.publishers.contract import About, News
from evertwin.publishers.ros import RosOut
from evertwin.publishers.ros_spec import RosOutSettings
from evertwin.ros.spec import Place
from evertwin.ros.topics import simulate
from evertwin.sources.robot_logs.bag_files import messages
from evertwin.sources.robot_logs.ros_messages import Decoder, flat
from tests.sources.live.ros_peers import STATES, master, until
from tests.sources.live.test_ros import children

SCENE = {"kind": "base", "pose": ["x", "y", "heading"], "tolerance": 0.1}
OUTPUTS = (("x", "m"), ("y", "m"), ("heading", "rad"))
JOINTS = [{"name": f"joint{k}", "input": f"q{k}", "speed": f"qd{k}", "output": f"tau{k}"}
          for k in (1, 2)]  # fmt: skip
HEALTH = {
    "condition": "out_of_specification", "why": "off by 9 %", "stale": False, "age": 0.1,
    "state": "running", "rows": 5, "champion": 2, "versions": 3, "headline": "better",
}  # fmt: skip
ODOMETRY = ("{transforms: [{header: {stamp: {secs: 100}, frame_id: odom}, child_frame_id: "
            "base_link, transform: {translation: {x: 1.0}, rotation: {w: 1.0}}}]}")  # fmt: skip


URDF = "<robot name='two'>" + "".join(f"<link name='link{k}'/>" for k in (0, 1, 2)) + "".join(
    f"<joint name='joint{k}' type='revolute'><parent link='link{k - 1}'/><child link='link{k}'/>"
    "<axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='9' velocity='9'/></joint>"
    for k in (1, 2)
) + "</robot>"  # fmt: skip


async def nobody(*_: object) -> dict[str, Any]:
    return {}


def publisher(uri: str, name: str, outputs: Any, scene: Any, **settings: Any) -> RosOut:
    told = RosOutSettings("ros", master=uri, **settings)
    return RosOut(told, About(name, outputs, scene), nobody)


def row(t: float, **values: tuple[float, float | None, int]) -> dict[str, Any]:
    """One row of predicted, measured and what became of it."""
    outputs = {
        name: {"predicted": [p], "measured": [m], "sigma": [0.02], "update": [u], "mark": [0],
               "residual": [None if m is None else m - p]}
        for name, (p, m, u) in values.items()
    }  # fmt: skip
    return {"t": [round(t * 1e9)], "outputs": outputs, "inputs": {"q1": [0.5], "q2": [-0.5],
            "qd1": [0.1], "qd2": [0.2]}}  # fmt: skip


async def wait(done: Callable[[], bool], seconds: float = 10.0) -> None:
    async with asyncio.timeout(seconds):
        while not done():
            await asyncio.sleep(0.02)


def heard(bag: Path) -> dict[str, list[Any]]:
    decoder, found = Decoder(), dict[str, list[Any]]()
    for message in messages(bag, "ros1"):
        found.setdefault(message.connection.topic, []).append(decoder.content(message))
    return found


@pytest.mark.system
def test_a_base_and_an_arm_as_rosbag_records_them(tmp_path: Path) -> None:
    bag = tmp_path / "said.bag"
    topics = ("/evertwin/robot_1/prediction", "/evertwin/robot_1/markers", "/diagnostics",
              "/evertwin/robot_1/path", "/evertwin/arm/prediction", "/tf")  # fmt: skip
    with master(tmp_path) as ros:
        base = publisher(ros.uri, "robot.1", OUTPUTS, SCENE, odom="odom")
        arm = publisher(ros.uri, "arm", (("tau1", "Nm"), ("tau2", "Nm")),
                        {"kind": "arm", "joints": JOINTS, "motors": False})  # fmt: skip

        async def speak() -> set[str]:
            base.open(), arm.open()
            await wait(lambda: base.health["state"] == arm.health["state"] == "up")
            for topic in topics[:-1]:  # to the recorder, and to who makes transforms of joints
                await wait(lambda: ros.connected(topic) >= 1 + (topic == topics[4]), 30.0)  # noqa: B023
            start = {"x": (1.0, 1.0, 4), "y": (2.0, 2.0, 4), "heading": (0.0, 0.0, 4)}
            moved = {"x": (1.2, 1.4, 1), "y": (2.0, 2.1, 1), "heading": (0.0, 0.5, 1)}
            for t, values in ((100.0, start), (101.0, moved)):
                base.publish(News("robot.1", "rows", row(t, **values)))
            arm.publish(News("arm", "rows", row(100.0, tau1=(3.0, 3.5, 0), tau2=(4.0, 4.0, 0))))
            with ros.node("rostopic", "pub", "-r", "20", "/tf", "tf2_msgs/TFMessage", ODOMETRY):
                await wait(lambda: base._placing.odom is not None)  # type: ignore[union-attr]
                await wait(lambda: base.health["sent"] > 3)
            fixed = ODOMETRY.replace("odom", "map").replace("base_link", "odom")
            with ros.node("rostopic", "pub", "-l", "/tf_static", "tf2_msgs/TFMessage", fixed):
                await wait(lambda: "another node places odom" in base.health["reason"])
            for one in (base, arm):
                one.publish(News("x", "health", HEALTH))
            await asyncio.sleep(2.0)  # what was said is on its way
            own = {topic for topic, nodes in ros.state()[0].items()
                   if any(node.startswith("/evertwin") for node in nodes)}  # fmt: skip
            await base.close(), await arm.close()
            return own

        with xmlrpc.client.ServerProxy(ros.uri) as asked:
            asked.setParam("/test", "/robot_description", URDF)
        states = ros.node(str(STATES), "joint_states:=/evertwin/arm/prediction")
        with ros.recording(bag, *topics), states:
            until(lambda: "/robot_state_publisher" in ros.state()[1].get(topics[4], ()))
            own = asyncio.run(speak())
    # nothing that moves a machine
    assert own == {*topics, "/evertwin/robot_1/measured"}
    check = subprocess.run(["rosbag", "check", str(bag)], capture_output=True, text=True)
    assert check.returncode == 0, check.stdout + check.stderr
    said = heard(bag)
    first, second = (dict(flat(one)) for one in said["/evertwin/robot_1/prediction"])
    assert (first["pose.pose.position.x"], second["pose.pose.position.x"]) == (1.0, 1.2)
    assert abs(second["twist.twist.linear.x"] - 0.2) < 1e-12
    joints = said["/evertwin/arm/prediction"][0]
    assert list(joints.name) == ["joint1", "joint2"] and list(joints.effort) == [3.0, 4.0]
    assert list(joints.position) == [0.5, -0.5] and list(joints.velocity) == [0.1, 0.2]
    spaces = {one.ns for array in said["/evertwin/robot_1/markers"] for one in array.markers}
    assert spaces == {"ghost", "updates"}
    status = {one.name: one for array in said["/diagnostics"] for one in array.status}
    assert set(status) == {
        "evertwin/robot.1",
        "evertwin/arm",
        "evertwin/arm: tau1",
        "evertwin/arm: tau2",
        *(f"evertwin/robot.1: {n}" for n, _ in OUTPUTS),
    }
    assert status["evertwin/robot.1"].level == 1
    assert status["evertwin/arm: tau1"].message == "off by 0.5 Nm"
    frames = {(one.header.frame_id, one.child_frame_id, one.transform.translation.x)
              for message in said["/tf"] for one in message.transforms}  # fmt: skip
    # at 100 s the odometry had it at x = 1, the first sample too; what came at 101 s still waits
    own_frames = {one for one in frames if one[0] in ("map", "odom") and one[1] == "odom"}
    assert own_frames == {("map", "odom", 0.0)}
    # robot_state_publisher makes frames of the joints, as it does of a machine's
    assert {one[:2] for one in frames} >= {("link0", "link1"), ("link1", "link2")}


@pytest.mark.system
def test_a_dead_child_and_a_master_that_comes_later(tmp_path: Path) -> None:
    with master(tmp_path) as ros:
        ros.kill()
        out = publisher(ros.uri, "robot", OUTPUTS, SCENE)

        async def live() -> None:
            out.open()
            await wait(lambda: out.health["state"] == "down")
            assert out.health["reason"].startswith("no master at")
            out.publish(News("robot", "rows", row(1.0, x=(1.0, 1.0, 0), y=(0.0, 0.0, 0),
                                                  heading=(0.0, 0.0, 0))))  # fmt: skip
            assert out.health["dropped"] == 2
            ros.start()
            await wait(lambda: out.health["state"] == "up")
            os.kill(children()[0], signal.SIGKILL)
            await wait(lambda: out.health["state"] == "down")
            assert "-9" in out.health["reason"]
            await wait(lambda: out.health["state"] == "up")
            await simulate(Place(ros.uri))  # a node that goes on would stamp by the old clock
            await wait(lambda: out.health["state"] == "down")
            assert "/use_sim_time was changed" in out.health["reason"]
            await wait(lambda: out.health["state"] == "up")
            await out.close()

        asyncio.run(live())
    assert not children()
