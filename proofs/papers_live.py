"""Both papers live, through `evertwin serve`: `python -m proofs.papers_live [SEEDS] [SPEED]`.

For each seed the embedded arm (Modbus) and the embedded robot (MQTT, a broker of its own) run for
ten minutes of their clock, in time-lapse, and a service in a process of its own runs their shipped
twin files by the shipped site file. While they run one axis of the arm wears by 30 % at 180 s, the
arm is pushed at 400 s, and a torque sensor gets a bias at 480 s. Then the service is stopped and
its stores are read.

    Fc         six friction coefficients inside 5 % before the wear, from angle, speed and torque
    worn       the worn axis inside 5 % again, live within two cycles (138 s)
    push       no version went live because of the push: all six still inside 5 %
    bias       not learned in silence: no version that went live after it, and it is told
    updates    the robot's position updates, first model against the live one over unseen rows
"""

from __future__ import annotations

import dataclasses
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import Twin
from evertwin.app.machine.demo_live import free_ports, site_of
from evertwin.app.machine.live_processes import Common, LiveMachine, arm_options, robot_options
from evertwin.config import read
from evertwin.store.spec import StoreSpec
from evertwin.worlds.arm import Truth
from planted.serving import Served
from proofs._verdict import ended

SECONDS = 600.0
WORN, PUSHED, BIASED = 180.0, 400.0, 480.0
CYCLE = 69.0
INSIDE = 0.05
TOLD = ("suspected", "drift", "measurement_error", "abnormal", "overruled")


def live(seed: int, speed: float, folder: Path) -> dict[str, Path]:
    """Runs everything for one seed; the stores of both twins."""
    axis, lying = seed % 6 + 1, (seed + 3) % 6 + 1
    truth = Truth()
    orders = [
        f"{WORN:g}:friction.{axis}=1.3",
        f"{PUSHED:g}:push.{lying}={10.0 * truth.coulomb[lying - 1]:g}",
        f"{BIASED:g}:bias.tau{lying}={0.4 * truth.coulomb[lying - 1]:g}",
    ]
    ports = free_ports(("modbus", "mqtt", "http"))
    both = Common(seed, speed, seconds=SECONDS)
    arm = arm_options(both._replace(order=orders), f"127.0.0.1:{ports['modbus']}", "")
    robot = robot_options(both, None, f"127.0.0.1:{ports['mqtt']}", topics="command,scan")
    site = site_of(folder, ports)
    store = site.parent / "demo-store"
    with ExitStack() as running:
        served = running.enter_context(Served(site))
        machines = [
            running.enter_context(LiveMachine("arm", arm)),
            running.enter_context(LiveMachine("robot", robot)),
        ]
        for one in machines:
            one.reached()
        for one in machines:
            one.wait()
        folded(served, store)
    return {name: store / f"{name}_live.db" for name in ("arm", "robot")}


def folded(served: Served, store: Path) -> None:
    """Waits until no sample waits, on a busy computer up to five minutes."""
    token = (store / "token").read_text().strip()
    end = time.monotonic() + 300.0
    while time.monotonic() < end:
        time.sleep(2.0)  # what is under way comes in
        twins = served.ask("/api/v1/status", token=token)[1]["twins"]
        if not any(one["waiting"] or one["busy"] for one in twins):
            return
    raise TimeoutError("samples still wait after 300 s: choose a smaller SPEED")


def opened(name: str, store: Path, folder: Path) -> Twin:
    """The twin as the service left it."""
    spec = read(folder / "twins" / f"{name}_live.toml")
    return Twin(dataclasses.replace(spec, store=StoreSpec(str(store))))


def friction(twin: Twin, number: int) -> np.ndarray:
    """Fc of a version."""
    value = {item.name: item.value for item in twin.parameters_of(number)}
    return np.array([value[f"Fc{axis}"] for axis in range(1, 7)])


def arm_found(twin: Twin, seed: int) -> dict[str, Any]:
    """What the arm's twin made of it, in seconds since the machine began."""
    true = np.array(Truth().coulomb)
    worn = true.copy()
    worn[seed % 6] *= 1.3
    begun = next(int(chunk.t[0]) for _, chunk in twin.store.read_chunks(1))
    promoted = [(0.0, 0)]
    events = []
    for event in twin.events:
        at = (event.time - begun) / 1e9
        events.append((at, event.kind, event.signal))
        if event.kind == "promoted":
            promoted.append((at, int(event.evidence["version"])))

    def live_at(t: float) -> np.ndarray:
        return friction(twin, [number for at, number in promoted if at <= t][-1])

    def off(t: float, against: np.ndarray) -> float:
        return float(np.max(np.abs(live_at(t) / against - 1.0)))

    again = [at for at, _ in promoted if at > WORN and off(at, worn) < INSIDE]
    late = [at for at, _ in promoted if at > BIASED]
    told = [at for at, kind, _ in events if at > BIASED and kind in TOLD]
    return {
        "Fc": off(WORN, true), "worn": again[0] - WORN if again else np.inf,
        "push": off(BIASED, worn), "learned": len(late),
        "told": told[0] - BIASED if told else np.inf,
    }  # fmt: skip


def robot_found(twin: Twin) -> dict[str, Any]:
    """The robot's position updates over the same unseen rows."""
    twin.going()
    before, after = twin.finish().position_updates
    return {"before": before, "after": after}


def main() -> int:
    """A line for each seed, then how many reached what."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    speed = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    reached: dict[str, list[bool]] = {}
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            stores = live(seed, speed, folder)
            with opened("arm", stores["arm"], folder) as twin:
                arm = arm_found(twin, seed)
            with opened("robot", stores["robot"], folder) as twin:
                robot = robot_found(twin)
        sys.stdout.write(
            f"seed {seed}: Fc off by {100 * arm['Fc']:.1f} %, worn axis {seed % 6 + 1} live after "
            f"{arm['worn']:.0f} s, after the push off by {100 * arm['push']:.1f} %, versions after "
            f"the bias {arm['learned']}, told after {arm['told']:.0f} s; updates "
            f"{robot['before']} -> {robot['after']}\n"
        )
        sys.stdout.flush()
        for what, good in {
            "Fc inside 5 %": arm["Fc"] < INSIDE,
            "worn joint live within two cycles": arm["worn"] <= 2 * CYCLE,
            "push not learned": arm["push"] < INSIDE,
            "bias not learned in silence": arm["learned"] == 0 and np.isfinite(arm["told"]),
            "updates / 3": robot["before"] >= 3 * robot["after"] and robot["before"] > 0,
        }.items():
            reached.setdefault(what, []).append(bool(good))
    for what, good in reached.items():
        failed = [str(k + 1) for k, one in enumerate(good) if not one]
        missed = f"; not: seeds {', '.join(failed)}" if failed else ""
        sys.stdout.write(f"{what}: {sum(good)} of {seeds}{missed}\n")
    return ended({what: all(good) for what, good in reached.items()})


if __name__ == "__main__":
    sys.exit(main())
