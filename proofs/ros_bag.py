"""Is a bag what was lived? `python -m proofs.ros_bag [SECONDS] [SPEED] [SEED]`.

The embedded robot speaks at a real ROS 1 master for so many seconds of its clock, in time-lapse,
while its floor slips and a sensor lies. `evertwin serve` runs its shipped twin file and a second
twin, whose inputs are the speeds of the wheels (a topic whose messages have a stamp of their own),
and says at the same master what they predict. Debian's rosbag records all of it. Then:

    check     what `rosbag check` says of the bag
    file      `Twin.run` on the bag: are its rows those of the service, in every bit?
    played    `rosbag play --clock` into a new service: are its rows those of the first one?

A message without a stamp (`/cmd_vel`) is stamped where it is heard: by the service, by the
recorder, by who hears the player, each at its own moment. So of the twin that takes its commands
from there the poses are demanded to be equal; how many rows are stamped otherwise, and how far that
takes its predictions, is printed.
"""

from __future__ import annotations

import asyncio
import dataclasses
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.app.machine.live_processes import Common, LiveMachine, robot_options
from evertwin.config import read
from evertwin.ros.spec import Place
from evertwin.ros.topics import simulate
from evertwin.store.spec import StoreSpec
from planted.serving import Served
from proofs._verdict import NO_DATA, ended
from tests.sources.live.ros_peers import Master

ROOT = Path(__file__).parent.parent
HEARD = ("/cmd_vel", "/amcl_pose", "/odom", "/imu", "/scan", "/tf", "/tf_static")
SAID = ("/diagnostics", "/evertwin/robot_ros/prediction", "/evertwin/robot_ros/path",
        "/evertwin/robot_ros/measured", "/evertwin/robot_ros/markers")  # fmt: skip
ORDERS = ("0.4:slip=0.1 for=60", "0.6:freeze.x=1 for=10")
WHEELS = {
    "/cmd_vel.logged": "/odom.stamp",
    "/cmd_vel.": "/odom.twist.twist.",
    'name = "robot_ros"': 'name = "robot_wheels"',
}
"""What makes the second twin of the first."""
NAMES = ("robot_ros", "robot_wheels")
HZ = 1000
"""Messages of /clock in a second of the player."""


def site_of(folder: Path, name: str, uri: str) -> Path:
    """A site with both twins, in a folder of its own."""
    own = folder / name
    own.mkdir()
    twin = (ROOT / "twins" / "robot_ros.toml").read_text()
    (own / "robot_ros.toml").write_text(twin)
    for old, new in WHEELS.items():
        twin = twin.replace(old, new)
    (own / "robot_wheels.toml").write_text(twin)
    text = (ROOT / "sites" / "robot_ros.toml").read_text()
    head, entry = text.split("[[twin]]", 1)
    head = head.replace("8700", "0").replace("robot-ros-store", "store")
    entry = f"[[twin]]{entry}".replace("../twins/", "")
    entry = entry.replace('protocol = "ros"', f'protocol = "ros"\nmaster = "{uri}"')
    second = entry.replace("robot_ros.toml", "robot_wheels.toml").split("[[twin.publisher]]")[0]
    file = own / "site.toml"
    file.write_text(head + entry + second)
    return file


def settled(served: Served) -> None:
    """Nothing comes any more, and nothing waits."""
    before = -1
    while True:
        time.sleep(1.0)
        twins = served.ask("/api/v1/status")[1]["twins"]
        now = sum(one["rows"] + one["waiting"] for one in twins)
        if now == before:
            return
        before = now


class Rows(NamedTuple):
    """Rows that were aligned, and what was predicted of them.

    >>> Rows._fields
    ('t', 'inputs', 'measured', 'predicted')
    """

    t: np.ndarray
    inputs: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray

    @property
    def poses(self) -> Rows:
        """Those at which a pose was measured."""
        seen = np.isfinite(self.measured).all(axis=1)
        return Rows(*(column[seen] for column in self))


def of_service(site: Path, name: str) -> Rows:
    """The rows that a service had."""
    store = StoreSpec(str(site.parent / "store" / f"{name}.db"))
    with Twin(dataclasses.replace(read(site.parent / f"{name}.toml"), store=store)) as twin:
        twin.going()
        view = twin.view(10**9)
    return Rows(view.t, view.inputs, view.measured, view.predicted)


def of_file(site: Path, name: str, bag: Path) -> Rows:
    """`Twin.run` on the bag."""
    with Twin(read(site.parent / f"{name}.toml")) as twin:
        trace = twin.run([bag]).trace
    return Rows(*(trace[name] for name in ("t", "input", "measured", "predicted")))


def same(one: Rows, other: Rows, *fields: str) -> bool:
    """Bit for bit, over the rows that both have; all but those that were still waited for."""
    count = min(len(one.t), len(other.t))
    return count > 0.9 * max(len(one.t), len(other.t)) and all(
        getattr(one, field)[:count].tobytes() == getattr(other, field)[:count].tobytes()
        for field in fields
    )


def played(ros: Master, folder: Path, bag: Path, speed: float) -> Path:
    """Plays it into a new service."""
    ros.kill()
    ros.start()
    asyncio.run(simulate(Place(ros.uri)))
    site = site_of(folder, "played", ros.uri)
    words = ["rosbag", "play", "--clock", "--hz", str(HZ), "-r", f"{speed:g}", "-d", "3", str(bag),
             "--topics", *HEARD]  # fmt: skip
    with Served(site) as served:
        served.until(lambda status: True)
        said = subprocess.run(
            words, env=ros.environment, capture_output=True, text=True, check=False
        )
        sys.stdout.write(f"rosbag play ends with {said.returncode}\n")
        settled(served)
    return site


def off(lived: Rows, other: Rows) -> str:
    """How far rows are those that were lived."""
    apart = len(np.setxor1d(lived.t, other.t[other.t <= lived.t[-1]]))
    (_, _, _, p), (_, _, _, q) = lived.poses, other.poses
    count = min(len(p), len(q))
    far = 1000 * np.abs(p[:count] - q[:count])[:, :2]
    return (
        f"{len(lived.t)} and {len(other.t)} rows, {apart} stamped otherwise; {count} poses, their "
        f"predictions apart by {np.nanmax(far):.3f} mm at most, "
        f"{np.nanmedian(far):.3f} in the median"
    )


def main(seconds: float = 160.0, speed: float = 2.0, seed: int = 1) -> int:
    """Prints what was found; exit code 0 if all holds."""
    if absent := [name for name in ("rosmaster", "rosbag") if shutil.which(name) is None]:
        sys.stdout.write(f"{', '.join(absent)} not installed: see docs/how-to/ros.md\n")
        return NO_DATA
    folder = Path(tempfile.mkdtemp())
    ros, bag = Master(folder), folder / "lived.bag"
    try:
        site = site_of(folder, "lived", ros.uri)
        planned = [f"{float(one.split(':')[0]) * seconds:g}:{one.split(':')[1]}" for one in ORDERS]
        common = Common(seed, speed, seconds=seconds, order=planned)
        asyncio.run(simulate(Place(ros.uri)))
        with Served(site) as served, ros.recording(bag, *HEARD, *SAID):
            served.until(lambda status: True)
            options = robot_options(common, None, ros=Place(ros.uri))
            with LiveMachine("robot", options) as machine:
                machine.reached()
                machine.wait()
            settled(served)
        check = subprocess.run(["rosbag", "check", str(bag)], capture_output=True, text=True)
        sys.stdout.write(f"rosbag check: {check.stdout.strip()} ({check.returncode})\n")
        sys.stdout.write(f"{bag.stat().st_size / 1e6:.1f} MB\n")
        demands = {"check": check.returncode == 0}
        lived = {name: of_service(site, name) for name in NAMES}
        found = {("file", name): of_file(site, name, bag) for name in NAMES}
        site = played(ros, folder, bag, speed)
        found |= {("played", name): of_service(site, name) for name in NAMES}
        for (how, name), rows in found.items():
            sys.stdout.write(f"{name}, {how}: {off(lived[name], rows)}\n")
            poses = same(lived[name].poses, rows.poses, "t", "measured")
            demands[f"{name}: {how}, poses"] = poses
            if name == "robot_wheels":
                rows_too = same(lived[name], rows, "t", "measured", "inputs")
                demands[f"{name}: {how}, rows"] = rows_too
        for name, reached in demands.items():
            sys.stdout.write(f"{name}: {'equal' if reached else 'NOT equal'}\n")
        return ended(demands)
    finally:
        with suppress(ProcessLookupError):
            ros.process.send_signal(signal.SIGTERM)
        ros.process.wait()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    words = sys.argv[1:]
    sys.exit(main(*(kind(word) for kind, word in zip((float, float, int), words, strict=False))))
