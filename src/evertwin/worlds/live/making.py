"""What both ways of running a machine share: its options, and the machine made of them."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from evertwin.worlds.drive import WORLDS
from evertwin.worlds.live.contract import Machine
from evertwin.worlds.live.life import Planned, Samples
from evertwin.worlds.live.machines.arm import LiveArm
from evertwin.worlds.live.machines.robot import LiveRobot
from evertwin.worlds.live.orders import Knob
from evertwin.worlds.live.voices.cable import cables

SPEEDS = (0.001, 1000.0)


def parser(says: str | None) -> argparse.ArgumentParser:
    """The options of a machine's process."""
    parser = argparse.ArgumentParser(description=says)
    parser.add_argument("machine", choices=("arm", "robot"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--speed", type=float, default=1.0, help="seconds of its clock in one")
    parser.add_argument("--start", type=float, help="of its clock, seconds since 1970")
    parser.add_argument("--seconds", type=float, default=math.inf, help="of its clock, to run")
    parser.add_argument("--order", action="append", default=[], help="SECONDS:ORDERS, planned")
    parser.add_argument("--urdf", type=Path, help="description of the arm")
    parser.add_argument("--world", choices=sorted(WORLDS), default="w3", help="of the robot")
    parser.add_argument("--camera", type=float, default=0.0, help="pictures of the robot a second")
    parser.add_argument("--topics", nargs="*", help="of the robot; absent: all")
    parser.add_argument("--ros", help="of the robot, in place of MQTT: address of a ROS 1 master")
    return parser


def machine_of(given: argparse.Namespace) -> Machine:
    """The machine that was asked for."""
    arm = given.machine == "arm"
    # what is said at a ROS master has no line that could be cut: each hears it by a line of its own
    lines = {} if given.ros else cables(("modbus", "opcua") if arm else ("mqtt",))
    speed = Knob("seconds of its clock in one of ours", *SPEEDS, neutral=given.speed)
    known = {**lines, "speed": speed}
    if arm:
        return LiveArm(given.urdf, given.seed, known)
    return LiveRobot(given.world, given.seed, known, given.camera)


def samples_of(given: argparse.Namespace, machine: Machine) -> Samples:
    """What it gives, with what is planned on the way."""
    return Samples(machine, given.seconds, [Planned.of(one) for one in given.order])
