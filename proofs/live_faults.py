"""What befalls a running service, one after the other: `python -m proofs.live_faults [ROUNDS]`.

The embedded arm (Modbus) and the embedded robot (MQTT, mosquitto) go on sending in time-lapse while

    broker      is killed every five seconds
    line        of the arm takes everything and gives nothing (half-open)
    disk        of the stores is full, a tmpfs (needs root, else it is left out)
    service     is started a second time on the same stores

Counted in the end: what the robot sent and the store lacks, what stands there twice, records twice,
champions beside another, and whether every twin runs again by itself. Hostile frames are counted by
`proofs.hostile`, stores with flipped bits by `proofs.damage`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from evertwin.app.machine.demo_live import free_ports, site_of
from evertwin.app.machine.live_processes import Common, LiveMachine, arm_options, robot_options
from planted.serving import Served
from planted.worlds import told_its_pose
from proofs._verdict import ended
from proofs.broker import SAVED, Broker
from proofs.service_kills import drained, found
from tests.sources.live.peers import Proxy

SIZE = 64
"""MB of the small disk."""


def small_disk(place: Path) -> bool:
    """A tmpfs; False: it may not be mounted."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}m", "tmpfs", str(place)]
    return os.geteuid() == 0 and subprocess.run(command, check=False).returncode == 0


class Hall:
    """The service, and what is asked of it."""

    def __init__(self, served: Served, store: Path) -> None:
        self.served, self.store = served, store

    def twins(self) -> dict[str, dict[str, Any]]:
        """Status by name."""
        token = (self.store / "token").read_text().strip()
        status = self.served.ask("/api/v1/status", token=token)[1]
        return {one["name"]: one for one in status["twins"]}

    def again(self, limit: float = 120.0) -> float:
        """Seconds until every twin runs and every source is up; infinite: not in so long."""
        began = time.monotonic()
        while time.monotonic() < began + limit:
            twins = self.twins().values()
            states = [source["state"] for one in twins for source in one["sources"].values()]
            if all(one["state"] == "running" for one in twins) and set(states) == {"up"}:
                return time.monotonic() - began
            time.sleep(0.2)
        return float("inf")


def filled(place: Path, seconds: float) -> None:
    """Not a byte is free for so long."""
    waste = place / "waste"
    try:
        with waste.open("wb", buffering=0) as file:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                try:
                    file.write(bytes(4096))
                except OSError:
                    time.sleep(0.1)
    finally:
        waste.unlink()


def befallen(hall: Hall, broker: Broker, line: Proxy, disk: Path | None) -> dict[str, float]:
    """One round; seconds until all is well again."""
    took = {}
    for _ in range(3):
        time.sleep(5.0)
        broker.stop(kill=True)
        time.sleep(0.2)
        broker.start()
    took["broker killed three times"] = hall.again()
    line.deaf = True
    time.sleep(6.0)
    line.deaf = False
    took["half-open Modbus"] = hall.again()
    if disk is not None:
        filled(disk, 8.0)
        took["full disk"] = hall.again()
    with Served(hall.served.file) as second:
        token = (hall.store / "token").read_text().strip()
        while not second.ask("/-/ready", token=token)[1]["ready"]:
            time.sleep(0.2)
        told = second.ask("/api/v1/status", token=token)[1]["twins"]
        refused = all("is open in process" in one["reason"] for one in told)
    took["second instance refused"] = hall.again() if refused else float("inf")
    return took


def main(rounds: int = 1, seed: int = 1, speed: float = 4.0) -> int:
    """Exit code 0 where nothing is lost, repeated or changed, and all resume by themselves."""
    if shutil.which("mosquitto") is None:
        print("mosquitto is not installed")
        return 4
    with tempfile.TemporaryDirectory() as name, ExitStack() as running:
        folder, broker = Path(name), Broker(*SAVED, "max_queued_messages 0")
        running.callback(broker.stop, kill=True)
        disk: Path | None = folder / "disk"
        if small_disk(folder / "disk"):
            running.callback(subprocess.run, ["umount", "-l", str(disk)], check=False)
        else:
            print("no tmpfs may be mounted: the full disk is left out")
            disk = None
        ports = free_ports(("modbus", "mqtt", "http"))
        line = running.enter_context(Proxy(ports["modbus"]))
        site = told_its_pose(site_of(folder, {"modbus": line.port, "mqtt": broker.port, "http": 0}))
        store = (disk or folder) / "store"
        text = re.sub(r"(?m)^store = .*$", f'store = "{store}"', site.read_text())
        site.write_text(text)
        both = Common(seed, speed)
        arm = arm_options(both, f"127.0.0.1:{ports['modbus']}", "")
        robot = robot_options(both, f"127.0.0.1:{broker.port}", topics="command,pose")
        hall = Hall(running.enter_context(Served(site)), store)
        machines = [LiveMachine("arm", arm), LiveMachine("robot", robot)]
        for one in machines:
            running.enter_context(one).reached()
        took = [{"start": hall.again()}]
        took += [befallen(hall, broker, line, disk) for _ in range(rounds)]
        for one in machines:
            one.__exit__()
        drained(hall.served, (store / "token").read_text().strip())
        hall.served.end()
        every = [seconds for one in took for seconds in one.values()]
        demands = {"each fault is over by itself": max(every) < 120.0}
        for one in took:
            for what, seconds in one.items():
                print(f"{what}: well again after {seconds:.1f} s")
        for twin in ("arm", "robot"):
            reached, told = found(twin, folder, store / f"{twin}_live.db")
            demands |= reached
            print(told)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
