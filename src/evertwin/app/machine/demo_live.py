"""The demonstration, live: both machines run and speak, their twins improve themselves beside them.

The arm speaks Modbus TCP, the robot MQTT through a broker that it brings; all in time-lapse, with
the factor on the screen. Where the robot is its twin tells by its scans; the true pose only scores
that. While they run one axis wears, the arm is pushed and scans get lost: what the twins make of it
is told as it becomes known. Nothing but what pip installs is needed.

    machine ─ Modbus ─► ┌─────────┐
                        │ service │ ─► lines on the screen, figures at the end
    machine ─ MQTT ───► └─────────┘
"""

from __future__ import annotations

import asyncio
import shutil
import socket
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import typer

from evertwin.app.console import Alive, show
from evertwin.app.machine.demo_recorded import shipped
from evertwin.app.machine.demo_truth import Truth, truth_at
from evertwin.app.machine.live_processes import (
    Common,
    LiveMachine,
    arm_options,
    robot_options,
    told,
)
from evertwin.service.service import Service
from evertwin.service.twin.runner import Runner
from evertwin.sources.live.contract import LiveSource
from evertwin.sync.arbiter.arbiter_loop import ADOPTED

SHOWN = ("suspected", "tuned", "corrected", "promoted", "measurement_error", "drift",
         "rolled_back", "changed", "rejected", "abnormal", "external", "recurring", "pose_lost",
         "pose_found", "scans_missing")  # fmt: skip
"""Kinds of events that are told."""
SPAN = 100
"""Rows over which position updates are counted."""
STANDS = 0.001
"""Pace of a machine that nobody hears yet: what a robot drives before its twin listens would be
lost, its sweep over all speeds first of all."""
PORTS = {"5020": "modbus", "1883": "mqtt", "8700": "http"}
"""What stands in the shipped site file, in whose place free ones come."""


PATIENCE = 75.0
"""Seconds of ours that the story waits for a twin that this computer has had no time for yet."""
SHOWN_FOR = 25.0
"""Seconds of ours that what a twin makes of the last act is shown at least."""


class Act(NamedTuple):
    """Something that is done to a machine.

    >>> Act(200.0, 1, "arm", "friction.2=1.3", "axis 2 rubs 30 % more").orders
    'friction.2=1.3'
    """

    at: float
    """Seconds of its time-lapse, at the earliest."""
    after: int
    """Versions that its twin promotes before: a busy computer is waited for."""
    machine: str
    orders: str
    says: str

    def is_due(self, lapsed: float, speed: float, promoted: int) -> bool:
        """Is it its turn, so many seconds into its time-lapse?

        >>> act = Act(200.0, 1, "arm", "", "")
        >>> act.is_due(190.0, 10.0, 1), act.is_due(210.0, 10.0, 1)
        (False, True)
        >>> act.is_due(210.0, 10.0, 0), act.is_due(950.0, 10.0, 0)
        (False, True)
        """
        late = lapsed >= self.at + PATIENCE * speed
        return lapsed >= self.at and (promoted >= self.after or late)


STORY = (
    Act(200.0, 1, "arm", "friction.2=1.3", "axis 2 of the arm wears: 30 % more friction"),
    Act(430.0, 2, "arm", "push.1=120 for=1.5", "somebody pushes the arm"),
    Act(500.0, 1, "robot", "drop=1 for=6", "all scans of the robot get lost for 6 s"),
)


@dataclass
class Told:
    """What one twin said so far.

    >>> Told().to_dict()["promoted"]
    0
    """

    events: list[Mapping[str, Any]] = field(default_factory=list)
    updates: list[bool] = field(default_factory=list)
    """Row by row, whether the pose was adopted."""
    t: list[int] = field(default_factory=list)
    """Stamps of the rows [ns]."""
    poses: list[list[float | None]] = field(default_factory=list)
    """x, y, heading as they were taken."""
    improved: float | None = None
    """Seconds of ours until the first promotion."""
    samples: int = 0
    """That came from its machine."""
    rows: int = 0
    serial: int = 0

    def count(self, kind: str) -> int:
        """Events of a kind."""
        return sum(event["kind"] == kind for event in self.events)

    def to_dict(self) -> dict[str, Any]:
        """Plain content."""
        found: dict[str, Any] = {
            "samples": self.samples, "rows": self.rows, "promoted": self.count("promoted"),
            "first_improvement": self.improved,
            "measurement_errors": self.count("measurement_error"),
            "events": [dict(event) for event in self.events],
        }  # fmt: skip
        if any(self.updates):
            first, last = self.updates[SPAN : 2 * SPAN], self.updates[-SPAN:]
            found["updates_per_row"] = {
                "before": sum(first) / max(len(first), 1), "after": sum(last) / max(len(last), 1)
            }  # fmt: skip
        return found


class Screen:
    """Lines with our time and the factor, unless one document is asked for.

    >>> Screen(speed=10.0, quiet=True).speed
    10.0
    """

    def __init__(self, speed: float, *, quiet: bool) -> None:
        self.speed, self._quiet, self._began = speed, quiet, time.monotonic()

    @property
    def seconds(self) -> float:
        """Of ours, since the first machine runs."""
        return time.monotonic() - self._began

    def begin(self) -> None:
        """The first machine runs."""
        self._began = time.monotonic()

    def say(self, who: str, text: str) -> None:
        """One line."""
        if not self._quiet:
            typer.echo(f"{self.seconds:6.1f} s × {self.speed:g}  {who:6} {text}")


def site_of(out: Path, ports: Mapping[str, int]) -> Path:
    """The shipped site file and twin files in a folder, with these ports.

    Raises:
        UsageError: it does not lie with the package.
    """
    for name in ("sites", "twins"):
        (out / name).mkdir(parents=True, exist_ok=True)
    for name in ("arm_live", "robot_live"):
        shutil.copy(shipped(f"twins/{name}.toml"), out / "twins")
    text = shipped("sites/demo.toml").read_text(encoding="utf-8")
    for usual, what in PORTS.items():
        text = text.replace(f"port = {usual}", f"port = {ports[what]}")
    (out / "sites" / "demo.toml").write_text(text, encoding="utf-8")
    return out / "sites" / "demo.toml"


def free_ports(names: tuple[str, ...]) -> dict[str, int]:
    """A free port of this computer for each name."""
    with ExitStack() as held:
        sockets = {name: held.enter_context(socket.socket()) for name in names}
        for one in sockets.values():
            one.bind(("127.0.0.1", 0))
        return {name: int(one.getsockname()[1]) for name, one in sockets.items()}


def run_live_demo(
    out: Path, seed: int, paced: tuple[float, float], headless: bool, as_json: bool
) -> None:
    """Runs in time-lapse by a factor, for so many seconds of ours at least: ``paced``; lines on
    stdout, or figures at the end."""
    speed, seconds = paced
    if (out / "sites" / "demo-store").exists():
        shutil.rmtree(out / "sites" / "demo-store")  # a demonstration begins anew
    screen = Screen(speed, quiet=as_json or headless)
    ports = free_ports(("modbus", "mqtt", "http"))
    arm = arm_options(Common(seed, STANDS), f"127.0.0.1:{ports['modbus']}", "")
    robot = robot_options(
        Common(seed, STANDS), None, f"127.0.0.1:{ports['mqtt']}",
        topics="command,scan,pose",
    )  # fmt: skip
    service = Service(site_of(out, ports))
    with LiveMachine("arm", arm) as one, LiveMachine("robot", robot) as other:
        machines, truth = {"arm": one, "robot": other}, truth_at(ports["mqtt"])
        found = asyncio.run(_beside(service, machines, truth, screen, seconds))
    content = {"schema": "evertwin.demo-live/1", "speed": speed, "seconds": seconds, **found}
    show(content, "\n".join(_summary(name, one) for name, one in found["twins"].items()), as_json)


def _summary(name: str, found: Mapping[str, Any]) -> str:
    """What one twin came to, in a line."""
    first = found["first_improvement"]
    better = "no improvement yet" if first is None else f"first improvement after {first:.0f} s"
    share = found.get("updates_per_row")
    told_ = "" if share is None else (
        f"; position updates a row: {share['before']:.2f} before, {share['after']:.2f} at the end"
    )  # fmt: skip
    off = found.get("off_truth")
    where = "" if off is None else (
        f"; its pose is off the truth by {100 * off['place']:.2g} cm and {off['heading']:.2g} rad"
    )  # fmt: skip
    return (
        f"{name}: {better}, {found['promoted']} promoted, {found['measurement_errors']} faults of "
        f"sensors{told_}{where}"
    )


async def _beside(
    service: Service, machines: Mapping[str, LiveMachine], source: LiveSource, screen: Screen,
    seconds: float,
) -> dict[str, Any]:  # fmt: skip
    """The service beside the machines, and the story; ``source``: of the robot's true pose."""
    begun = time.monotonic()
    with Alive() as alive:
        alive.say("both machines start (MuJoCo, processes of their own)")
        waiting = (asyncio.to_thread(one.reached) for one in machines.values())
        reached = await asyncio.gather(*waiting)
        starting = asyncio.create_task(service.start())
        while not (_listening(service, machines) or starting.done()):
            await asyncio.sleep(0.1)
    truth = Truth()
    source.open()
    listening = asyncio.create_task(truth.listen(source))
    controls = {name: one["control"] for name, one in zip(machines, reached)}
    screen.begin()
    for name in machines.keys() - _listening(service, machines):
        screen.say(name, "waits until its twin's machine code is made, once, or read")
    said = {name: Told() for name in service.runners}
    story = [act for act in STORY if act.at <= seconds * screen.speed]
    runs, shown = dict[str, float](), 0.0  # machine → seconds when its time-lapse began
    try:
        while (
            story
            or len(runs) < len(machines)
            or screen.seconds < max(shown, max(runs.values()) + seconds)
        ):
            if starting.done():
                starting.result()
            for name in _listening(service, machines).difference(runs):
                await asyncio.to_thread(told, controls[name], f"speed={screen.speed:g}")
                runs[name] = screen.seconds
                screen.say(name, f"runs; time-lapse: {screen.speed:g} of its seconds in one")
            await asyncio.sleep(0.1)
            promoted = {name: said[f"{name}_live"].count("promoted") for name in machines}
            lapsed = {name: (screen.seconds - since) * screen.speed for name, since in runs.items()}
            for act in [
                one for one in story
                if one.is_due(lapsed.get(one.machine, -1.0), screen.speed, promoted[one.machine])
            ]:  # fmt: skip
                story.remove(act)
                await asyncio.to_thread(told, controls[act.machine], act.orders)
                screen.say("you", act.says)
                shown = screen.seconds + SHOWN_FOR
            for name, runner in service.runners.items():
                _listen(runner, said[name], screen, begun)
    finally:
        await service.stop()
        listening.cancel()
        source.close()
    twins = {name: one.to_dict() for name, one in said.items()}
    for name, one in said.items():
        off = truth.score(one.t, one.poses)
        if off is not None:
            twins[name]["off_truth"] = {"place": off[0], "heading": off[1]}
    return {"twins": twins}


def _listening(service: Service, machines: Mapping[str, LiveMachine]) -> set[str]:
    """Machines whose twins listen, or never will."""
    states = {name: runner.state for name, runner in service.runners.items()}
    return {name for name in machines if states.get(f"{name}_live", "starting") != "starting"}


def _listen(runner: Runner, said: Told, screen: Screen, begun: float) -> None:
    """What is new from one twin."""
    name, said.rows = runner.name.removesuffix("_live"), runner.row
    said.samples = sum(source.health.received for source in runner.sources)
    for _, event in list(runner.events)[len(said.events) :]:
        said.events.append(event)
        if event["kind"] == "promoted" and said.improved is None:
            said.improved = time.monotonic() - begun
        if event["kind"] in SHOWN:
            screen.say(name, f"{event['kind']}: {event['reason']}")
    for serial, rows in list(runner.rows):
        if serial <= said.serial or "x" not in rows["outputs"]:
            continue
        said.serial = serial
        said.t += rows["t"]
        posed = (rows["outputs"][one]["measured"] for one in ("x", "y", "heading"))
        said.poses += [list(one) for one in zip(*posed)]
        for became in rows["outputs"]["x"]["update"]:
            said.updates.append(became == ADOPTED)
            if len(said.updates) % SPAN == 0:
                count = sum(said.updates[-SPAN:])
                screen.say(name, f"{count} position updates in its newest {SPAN} rows")
