"""``python -m evertwin.worlds.live arm|robot``: a machine that runs and speaks.

When it listens it says where, in one line of JSON on stdout.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys

from evertwin.errors import EvertwinError
from evertwin.ros.spec import Place
from evertwin.worlds.live.contract import Machine
from evertwin.worlds.live.life import Life
from evertwin.worlds.live.making import machine_of, parser, samples_of
from evertwin.worlds.live.voices.arm_voice import ArmVoice
from evertwin.worlds.live.voices.robot_voice import RobotVoice
from evertwin.worlds.live.voices.ros import RosVoice
from evertwin.worlds.live.voices.voices import Voice, address


def _given(arguments: list[str] | None) -> argparse.Namespace:
    options = parser(__doc__)
    options.add_argument("--control", type=int, default=0, help="port on loopback for orders")
    options.add_argument("--modbus", help="HOST:PORT")
    options.add_argument("--opcua", help="HOST:PORT")
    options.add_argument("--broker", help="HOST:PORT of a broker that is there")
    options.add_argument("--own-broker", help="HOST:PORT at which a broker is started")
    options.add_argument("--python", default=Place().python, help="the one that has rospy")
    return options.parse_args(arguments)


def _voice(given: argparse.Namespace, machine: Machine) -> Voice:
    if given.machine == "arm":
        modbus, opcua = (one and address(one) for one in (given.modbus, given.opcua))
        return ArmVoice(tuple(machine.units["state"]), modbus, opcua)
    if given.ros is not None:
        return RosVoice(Place(given.ros, given.python), given.topics)
    own = given.broker is None
    broker = address(given.own_broker if own else given.broker)
    return RobotVoice(broker, given.topics, own=own)


def main(arguments: list[str] | None = None) -> None:
    """Runs until it is stopped or its seconds are over."""
    given = _given(arguments)
    machine = machine_of(given)

    def ready(reached: dict[str, str], start: float) -> None:
        told = {"machine": machine.name, "speed": given.speed, "start": start, **reached}
        sys.stdout.write(json.dumps(told) + "\n")
        sys.stdout.flush()

    life = Life(machine, _voice(given, machine), given.start)
    asyncio.run(life.run(samples_of(given, machine), given.control, ready))


if __name__ == "__main__":
    try:
        main()
    except (EvertwinError, OSError) as error:
        sys.exit(f"{error}")
