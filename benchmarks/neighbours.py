"""Do twins notice a neighbour that goes wrong? `python -m benchmarks.neighbours [TWINS] [TURNS]`.

So many twins of `twins/robot1d.toml` with fifty rows a second run in one service beside

    good      two twins with a model in Python;
    bad       one whose model raises an error after some rows, and one whose fit never ends and
              fills a core (its process is one of those that all twins share).

Good and bad take turns. Each twin's p99, from the arrival of a sample until its verdict is durable,
is of its newest thousand rows; told is the middle twin's and the worst one's, of each turn. Asked:
bad at most 10 % above good. The good ask for no requirement, so that no fit of theirs is in it.
What other programs take of the machine stands beside it.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks.crowd import busy, children, processor
from planted.serving import TWINS, Served, site
from planted.worlds import record_robot

RATE = 50.0
WARM = 40.0
SECONDS = 25.0
FOLDED = re.compile(
    r'^evertwin_twin_folded_seconds\{twin="(good\d+)"\} (\S+)$', re.MULTILINE
)  # fmt: skip
PLUG_IN = """
import sys

from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout

COUNT = [0]


class Poison(FunctionModel):
    def simulate(self, x, u, dt, p):
        COUNT[0] += len(u)
        if COUNT[0] > 1000:
            raise RuntimeError("poison")
        return super().simulate(x, u, dt, p)


class Endless(FunctionModel):
    def simulate(self, x, u, dt, p):
        while "evertwin.engine.worker" in sys.modules:
            pass
        return super().simulate(x, u, dt, p)


def made(kind):
    line = Layout.of(x="m")
    gain = Parameters.of(gain=(1.0, "1"))
    return kind(step, Layout.of(v="m/s"), line, line, gain)


def step(x, u, dt, p):
    return [x[0] + p[0] * u[0] * dt], [x[0]]


def plain():
    return made(FunctionModel)


def poison():
    return made(Poison)


def endless():
    return made(Endless)
"""
POINTS = """[evertwin.models]
plain = planted_bad:plain
poison = planted_bad:poison
endless = planted_bad:endless
"""
ABOUT = "Metadata-Version: 2.1\nName: planted-bad\nVersion: 1.0\n"


def planted(folder: Path) -> Path:
    """A package with two models that go wrong, as pip would install it."""
    about = folder / "planted_bad-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(ABOUT)
    (about / "entry_points.txt").write_text(POINTS)
    (folder / "planted_bad.py").write_text(PLUG_IN)
    return folder


def turn(folder: Path, count: int, wrong: bool) -> tuple[float, float]:
    """One service; p99 of the middle twin and of the worst [s]."""
    folder.mkdir()
    record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", "8000")
    others = ("poison", "endless") if wrong else ("plain0", "plain1")
    file = site(folder, *(f"good{k}" for k in range(count)), *others, speed=RATE, workers=1)
    text = file.read_text().replace("workers = 1\n", "")  # they share the service's processes
    robot = folder / "robot1d.toml"
    robot.write_text(robot.read_text().replace('requirement = "1 cm"', ""))
    for name in others:
        own = (TWINS / "robot1d.toml").read_text().replace('"robot1d"', f'"{name.strip("01")}"')
        if not wrong:
            own = own.replace('requirement = "1 cm"', "")
        (folder / f"{name}.toml").write_text(own)
        text = text.replace(f'"robot1d.toml"\nname = "{name}"', f'"{name}.toml"\nname = "{name}"')
    file.write_text(text)
    with ExitStack() as running:
        path = ":".join([str(planted(folder)), *sys.path[1:]])
        served = Served(file, PYTHONPATH=path)
        running.callback(served.kill)
        served.until(
            lambda told: all(t["rows"] for t in told["twins"] if t["name"].startswith("good")),
            300.0,
        )
        time.sleep(WARM)
        every = children(served.process.pid)
        began, spent, whole = time.perf_counter(), sum(map(processor, every)), busy()
        time.sleep(SECONDS)
        span = time.perf_counter() - began
        own_share = (sum(map(processor, every)) - spent) / span
        other_share = (busy() - whole) / span - own_share
        late = np.array([float(one) for _, one in FOLDED.findall(str(served.ask("/metrics")[1]))])
        how = {t["name"]: (t["state"], t["rows"]) for t in served.ask("/api/v1/status")[1]["twins"]}
    told = ", ".join(f"{name} {how[name][0]} at row {how[name][1]}" for name in others)
    print(f"{'bad ' if wrong else 'good'} p99 {1e3 * np.median(late):6.1f} ms (worst twin "
          f"{1e3 * late.max():6.1f} ms), processors: own {own_share:.2f}, others "
          f"{other_share:.2f}; {told}", flush=True)  # fmt: skip
    return float(np.median(late)), float(late.max())


def main(count: int = 10, turns: int = 3) -> None:
    """Prints the figures."""
    found: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    with tempfile.TemporaryDirectory() as name:
        for k in range(2 * turns):
            wrong = bool(k % 2)
            found[wrong].append(turn(Path(name) / str(k), count, wrong))
    good, bad = (np.median(found[wrong], axis=0) for wrong in (False, True))
    print(f"bad / good, medians of {turns} turns: middle twin {bad[0] / good[0]:.2f}, worst twin "
          f"{bad[1] / good[1]:.2f}")  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
