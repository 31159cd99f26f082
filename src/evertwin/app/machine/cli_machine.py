"""The commands ``evertwin machine …`` and ``evertwin demo``: embedded machines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.options import AsJson, group

app = typer.Typer()
machine_app = group(
    "machine", "Embedded machines that run: arm (Modbus, OPC UA), robot (MQTT or ROS 1); tell them."
)
Seed = Annotated[int, typer.Option(help="Of noise and commands.")]
Speed = Annotated[
    float, typer.Option(min=0.1, max=1000.0, help="Time-lapse: seconds of its clock in one.")
]
Start = Annotated[
    float | None,
    typer.Option(
        help="Of its clock, seconds since 1970. Default: now; of a recording: 0, of a bag: 1."
    ),
]
Seconds = Annotated[float | None, typer.Option(min=0.0, help="Of its clock, to run.")]
Order = Annotated[
    list[str] | None,
    typer.Option("--order", help="SECONDS:ORDERS, planned: 60:friction.2=1.3; repeat."),
]
Control = Annotated[int, typer.Option(help="Port on loopback for orders; 0: any free one.")]
Record = Annotated[
    Path | None,
    typer.Option(help="Write what it would publish in --seconds, at once, and end."),
]


@machine_app.command("arm")
def arm(
    seed: Seed = 1,
    speed: Speed = 1.0,
    start: Start = None,
    seconds: Seconds = None,
    order: Order = None,
    control: Control = 5021,
    record: Record = None,
    modbus: Annotated[str, typer.Option(help="HOST:PORT of its registers; '': none.")] = (
        "127.0.0.1:5020"
    ),
    opcua: Annotated[str, typer.Option(help="HOST:PORT of its variables; '': none.")] = (
        "127.0.0.1:4840"
    ),
) -> None:
    """A 6-axis arm that welds: angle, speed, torque by Modbus TCP and OPC UA, ten times a second.

    Example: evertwin machine arm --speed 10
    """
    from evertwin.app.machine.live_processes import Common, arm_options, run_machine

    common = Common(seed, speed, start, seconds, order or [], control, record)
    run_machine("arm", arm_options(common, modbus, opcua), common)


@machine_app.command("robot")
def robot(
    seed: Seed = 1,
    speed: Speed = 1.0,
    start: Start = None,
    seconds: Seconds = None,
    order: Order = None,
    control: Control = 5022,
    record: Record = None,
    world: Annotated[str, typer.Option(help="Its drive: w1, w2, w3, w4.")] = "w3",
    broker: Annotated[
        str | None, typer.Option(help="HOST:PORT of an MQTT broker. Default: it starts one.")
    ] = None,
    own_broker: Annotated[str, typer.Option(help="HOST:PORT of the broker it starts.")] = (
        "127.0.0.1:1883"
    ),
    topics: Annotated[
        str, typer.Option(help="Of command,pose,odom,imu,scan; none named: all.")
    ] = "",
    ros: Annotated[
        bool, typer.Option("--ros", help="Speak at a ROS 1 master, in place of MQTT.")
    ] = False,
    master: Annotated[
        str, typer.Option(envvar="ROS_MASTER_URI", help="Address of that master.")
    ] = "http://127.0.0.1:11311",
    python: Annotated[str, typer.Option(help="The Python that has rospy.")] = "/usr/bin/python3",
    camera: Annotated[
        float, typer.Option(min=0.0, max=10.0, help="Pictures a second, into --record FILE.mcap.")
    ] = 0.0,
) -> None:
    """A transport robot in a hall: command, pose, odometry, gyro and lidar by MQTT or ROS 1.

    Example: evertwin machine robot --speed 10
    """
    from evertwin.app.machine.live_processes import Common, robot_options, run_machine
    from evertwin.errors import UsageError
    from evertwin.ros.spec import Masters

    common = Common(seed, speed, start, seconds, order or [], control, record)
    place = Masters(master, python).place if ros else None
    if camera and (record is None or record.suffix != ".mcap"):
        raise UsageError("--camera: expected --record FILE.mcap too, which the pictures go into")
    options = robot_options(common, broker, own_broker, world, topics, place)
    options += ["--camera", str(camera)] if camera else []
    run_machine("robot", options, common)


@machine_app.command("tell")
def tell(
    where: Annotated[str, typer.Argument(help="HOST:PORT of its orders.", metavar="HOST:PORT")],
    orders: Annotated[
        list[str] | None, typer.Argument(help="NAME=NUMBER; none: what it knows.")
    ] = None,
) -> None:
    """Tell a running machine to wear, to carry, to lie with a sensor, to lose a cable.

    Example: evertwin machine tell 127.0.0.1:5021 friction.2=1.3 payload=2 for=20
    """
    from evertwin.app.machine.live_processes import tell_machine

    tell_machine(where, orders or [])


@app.command()
def demo(
    seed: Annotated[int, typer.Option(help="Seed of the embedded machines.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for recordings and reports.")] = Path(
        "evertwin-demo"
    ),
    live: Annotated[
        bool, typer.Option("--live", help="While they run: Modbus, MQTT, one service.")
    ] = False,
    speed: Annotated[
        float, typer.Option(min=0.1, max=100.0, help="Time-lapse of the live machines.")
    ] = 10.0,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Length of the live one, at least.")
    ] = 90.0,
    headless: Annotated[bool, typer.Option("--headless", help="Nothing but the end.")] = False,
    as_json: AsJson = False,
) -> None:
    """Both embedded machines through the whole loop: a mobile robot and a 6-axis arm.

    Example: evertwin demo --out shown
    """
    if live:
        from evertwin.app.machine.demo_live import run_live_demo

        return run_live_demo(out, seed, (speed, seconds), headless, as_json)
    from evertwin.app.machine.demo_recorded import run_demo

    run_demo(out, seed, as_json)
