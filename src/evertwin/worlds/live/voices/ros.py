"""What the robot says at a ROS 1 master, under the names that Gazebo's robots have.

    command   /cmd_vel     geometry_msgs/Twist                       what it is told
    pose      /amcl_pose   geometry_msgs/PoseWithCovarianceStamped   where a localisation has it
    odom      /odom, /tf   nav_msgs/Odometry, odom → base_link       what its wheels have done
    imu       /imu         sensor_msgs/Imu                           its gyro
    scan      /scan        sensor_msgs/LaserScan                     its lidar

Its clock is ROS's: ``/clock`` with ``/use_sim_time``, so time-lapse needs nothing more. A message
without a header (``/cmd_vel``) is stamped by whoever hears it, by the newest ``/clock``: so it goes
out in the middle between two of them.

>>> stamp(12.5)
{'secs': 12, 'nsecs': 500000000}
>>> said("command", 12.5, {"v": 20.0, "w": 0.1})
('/cmd_vel', {'linear': {'x': 0.2}, 'angular': {'z': 0.1}})
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from evertwin.backoff import Backoff
from evertwin.ros.node import LATE, Node, NodeDown, node_at
from evertwin.ros.spec import Place
from evertwin.ros.topics import simulate
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.voices.cable import Cable

CONNECT = 1.0
"""Seconds in which who waits for the topics can connect, before the machine begins."""
LONGEST = 0.05
"""Seconds between ``/clock`` and a message that is stamped by it, at most."""
TYPES = {
    "/cmd_vel": "geometry_msgs/Twist",
    "/amcl_pose": "geometry_msgs/PoseWithCovarianceStamped",
    "/odom": "nav_msgs/Odometry",
    "/tf": "tf2_msgs/TFMessage",
    "/imu": "sensor_msgs/Imu",
    "/scan": "sensor_msgs/LaserScan",
    "/clock": "rosgraph_msgs/Clock",
}
MOUNTED = {"base_scan": 0.25, "imu_link": 0.1}
"""Sensors, and their heights above the floor [m]."""
NEAREST, FARTHEST = 0.05, 25.0
"""Range of the lidar [m]."""
Content = dict[str, Any]
Values = Mapping[str, float | Sequence[float]]


def stamp(t: float) -> Content:
    """Seconds since 1970; the machine's clock has steps of 0.1 ms at least."""
    steps = round(t * 1e4)
    return {"secs": steps // 10**4, "nsecs": steps % 10**4 * 10**5}


def said(topic: str, t: float, values: Values) -> tuple[str, Content]:
    """Topic and content of a sample of the machine's ``topic``, at its time [s]."""
    return _SAID[topic](t, values)


def turned(heading: float) -> Content:
    """A heading as a quaternion."""
    return {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}


def _header(t: float, frame: str) -> Content:
    return {"stamp": stamp(t), "frame_id": frame}


def _command(_: float, values: Any) -> tuple[str, Content]:
    return "/cmd_vel", {"linear": {"x": values["v"] / 100.0}, "angular": {"z": values["w"]}}


def _pose(t: float, values: Any) -> tuple[str, Content]:
    place = {"x": values["x"] / 100.0, "y": values["y"] / 100.0}
    pose = {"position": place, "orientation": turned(values["heading"])}
    return "/amcl_pose", {"header": _header(t, "map"), "pose": {"pose": pose}}


def _odom(t: float, values: Any) -> tuple[str, Content]:
    place = {"x": values["x"], "y": values["y"]}
    pose = {"position": place, "orientation": turned(values["heading"])}
    twist = {"linear": {"x": values["v"]}, "angular": {"z": values["w"]}}
    return "/odom", {
        "header": _header(t, "odom"), "child_frame_id": "base_link", "pose": {"pose": pose},
        "twist": {"twist": twist},
    }  # fmt: skip


def _imu(t: float, values: Any) -> tuple[str, Content]:
    unknown = [-1.0] + [0.0] * 8  # it has neither a compass nor an accelerometer
    return "/imu", {
        "header": _header(t, "imu_link"), "angular_velocity": {"z": values["gyro"]},
        "orientation_covariance": unknown, "linear_acceleration_covariance": unknown,
    }  # fmt: skip


def _scan(t: float, values: Any) -> tuple[str, Content]:
    ranges = [one if one >= 0 else math.inf for one in values["ranges"]]
    step = math.tau / len(ranges)
    return "/scan", {
        "header": _header(t, "base_scan"), "angle_min": 0.0, "angle_max": math.tau - step,
        "angle_increment": step, "range_min": NEAREST, "range_max": FARTHEST, "ranges": ranges,
    }  # fmt: skip


_SAID = {"command": _command, "pose": _pose, "odom": _odom, "imu": _imu, "scan": _scan}


def transform(t: float, values: Any) -> Content:
    """``odom → base_link``."""
    place = {"translation": {"x": values["x"], "y": values["y"]},
             "rotation": turned(values["heading"])}  # fmt: skip
    head = _header(t, "odom")
    return {"transforms": [{"header": head, "child_frame_id": "base_link", "transform": place}]}


def mounted() -> Content:
    """Where the sensors are on the base."""
    return {"transforms": [
        {"header": {"frame_id": "base_link"}, "child_frame_id": name,
         "transform": {"translation": {"z": height}, "rotation": turned(0.0)}}
        for name, height in MOUNTED.items()
    ]}  # fmt: skip


class RosVoice:
    """What the robot says at a master, of all its ``topics`` or these.

    >>> RosVoice(Place(), None).cables
    {}
    """

    def __init__(self, place: Place, topics: Sequence[str] | None) -> None:
        self._place, self._topics = place, topics
        self.cables: dict[str, Cable] = {}
        self._node: Node | None = None
        self._first = asyncio.Event()
        self._why = ""
        self._clock = -math.inf
        self._ticked = -math.inf
        self._half = LONGEST
        """Half the time between the newest two messages of the clock [s]."""
        self._task: asyncio.Task[None] | None = None

    async def open(self) -> dict[str, str]:
        self._task = asyncio.create_task(self._keep())
        async with asyncio.timeout(2 * LATE):
            await self._first.wait()
        if self._node is None:
            await self.close()
            raise NodeDown(self._why)
        await asyncio.sleep(CONNECT)
        return {"ros": self._place.master}

    async def _keep(self) -> None:
        """A node at the master, and when it is gone another one."""
        wait = Backoff()
        while True:
            try:
                await simulate(self._place)
                async with node_at(self._place, "evertwin_robot") as node:
                    for topic, kind in TYPES.items():
                        node.advertise(topic, kind)
                    node.advertise("/tf_static", TYPES["/tf"], latch=True)
                    node.publish("/tf_static", mounted())
                    self._node = node
                    self._first.set()
                    wait.reset()
                    await asyncio.shield(node.ended)
            except (NodeDown, OSError, TimeoutError) as error:
                self._why = str(error) or type(error).__name__
                self._first.set()
            finally:
                self._node = None
            await asyncio.sleep(wait.next())

    async def say(self, sample: Sample) -> None:
        if self._node is None:
            return
        if sample.t != self._clock:
            self._tick(self._node, sample.t)
        unheard = any(isinstance(v, float) and math.isnan(v) for v in sample.values.values())
        if unheard or (self._topics is not None and sample.topic not in self._topics):
            return
        topic, content = said(sample.topic, sample.t, sample.values)
        if sample.topic == "command":
            asyncio.get_running_loop().call_later(self._half, self._node.publish, topic, content)
            return
        self._node.publish(topic, content)
        if sample.topic == "odom":
            self._node.publish("/tf", transform(sample.t, sample.values))

    def _tick(self, node: Node, t: float) -> None:
        now = time.monotonic()
        self._half = min(LONGEST, (now - self._ticked) / 2)
        self._clock, self._ticked = t, now
        node.publish("/clock", {"clock": stamp(t)})

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
