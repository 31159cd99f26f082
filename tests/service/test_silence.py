"""A source that stays away: how long rows wait for it, and who is told."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.fold import Chunk
from evertwin.service.health.condition import Condition
from evertwin.service.site.site_plan import read_site
from evertwin.service.twin import runner as room
from evertwin.service.twin.process import Process
from evertwin.service.twin.quiet_sources import Silence
from evertwin.service.twin.runner import Runner
from evertwin.sources.live.contract import Health
from planted.serving import TWINS

PERIOD = 0.02
SECOND = 10**9
ENTRY = """
[[twin.source]]
source = "{name}"
protocol = "replay"
files = ["{name}.csv"]
"""


class Speaks:
    """A source that gives a sample every 20 ms, one second of its own clock, until it is cut."""

    def __init__(self, name: str, width: int, cut_at: float) -> None:
        self.name, self.width, self.cut_at = name, width, cut_at
        self.health, self.closed = Health("up"), asyncio.Event()

    def open(self) -> None:
        pass

    def resume(self, stamp: int, task: int = 0) -> None:
        pass

    def committed(self, chunk: Chunk) -> None:
        pass

    def close(self) -> None:
        self.closed.set()

    async def chunks(self) -> AsyncIterator[Chunk]:
        k = 0
        while not self.closed.is_set():
            if k < self.cut_at:
                yield Chunk(self.name, np.array([k * SECOND]), np.full((1, self.width), 0.01 * k))
            k += 1
            await asyncio.sleep(PERIOD)


def robot(folder: Path, timeout: str, monkeypatch: pytest.MonkeyPatch) -> Runner:
    """A robot whose camera is cut after ten samples, with such a time-out."""
    twin = (TWINS / "robot_pose.toml").read_text()
    assert twin.count('timeout = "3 s"\n') == 2
    (folder / "robot.toml").write_text(twin.replace('timeout = "3 s"\n', timeout))
    (folder / "store").mkdir()
    entries = "".join(ENTRY.format(name=name) for name in ("command", "pose"))
    (folder / "site.toml").write_text(
        'schema = 1\nname = "hall"\nwarm = false\n[http]\nport = 0\n'
        f'[[twin]]\nfile = "robot.toml"\nworkers = 0\nstale = "0.5 s"\n{entries}'
    )

    def opened(one: Any, spec: Any, around: Any) -> Speaks:
        return Speaks(spec.name, len(spec.channels), 10 if spec.name == "pose" else math.inf)

    monkeypatch.setattr(room, "open_live", opened)
    plan = read_site(folder / "site.toml").twins[0]
    return Runner(plan, folder / "store", Process())


async def watched(one: Runner, seconds: float) -> dict[str, Any]:
    await one.start()
    assert one.state == "running", one.reason
    end = time.monotonic() + seconds
    while time.monotonic() < end and (
        one.row < 30 or all(event["kind"] != "silent" for _, event in one.events)
    ):
        await asyncio.sleep(0.02)
    told = one.status()
    await one.stop()
    return told


def test_rows_go_on_without_a_source_whose_time_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = robot(tmp_path, 'timeout = "1 s"\n', monkeypatch)
    told = asyncio.run(watched(one, 20.0))
    assert told["rows"] >= 30 and not told["stale"] and told["condition"] == "check"
    assert told["why"].startswith("pose: no samples for")
    said = [(event["kind"], event["signal"]) for _, event in one.events]
    assert said.count(("silent", "pose")) == 1 and ("silent", "command") not in said


def test_a_twin_that_waits_for_a_source_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = robot(tmp_path, "", monkeypatch)
    told = asyncio.run(watched(one, 2.0))
    assert told["rows"] <= 10 and told["stale"] and told["condition"] == "check"
    assert told["why"].startswith("pose: no samples for")


def test_ticks_follow_the_clock_of_the_samples_and_end() -> None:
    silence = Silence({"wheels": 1.0, "camera": 5.0}, now=0.0)
    assert silence.tick(9.0) is None  # nobody has said yet what time it is
    silence.came(Chunk("wheels", np.array([100 * SECOND]), np.zeros((1, 1)), 3), now=10.0)
    late = silence.tick(10.5)
    assert late is not None and (late.t[0], late.task) == (100.5 * SECOND, 3)
    found = [silence.tick(10.5 + k) for k in range(1, 20)]
    stamps = [int(tick.t[0]) // SECOND for tick in found if tick is not None]
    assert stamps == [101, 102, 103, 104, 105]  # behind all that waits: no more
    silence.came(Chunk("wheels", np.array([SECOND]), np.zeros((1, 1)), 4), now=40.0)
    again = silence.tick(40.1)  # of another task, whose stamps begin anew
    assert again is not None and again.t[0] == 1.1 * SECOND


def test_one_source_of_two_is_missed_by_name() -> None:
    condition = Condition({"wheels": math.inf, "camera": 0.0}, stale=0.01)
    assert condition.told(failed=False)["why"] == "no samples"
    condition.came("wheels")
    told = condition.told(failed=False)
    assert (told["why"], told["stale"], told["condition"]) == ("camera: no samples", False, "check")
    assert condition.told(failed=False, over={"camera"})["condition"] == "good"
    time.sleep(0.02)
    condition.came("camera")
    assert condition.told(failed=False)["why"] == "wheels: no samples for 0 s"
    assert condition.told(failed=False)["stale"]  # its rows wait for the wheels


def test_a_sensor_that_is_refused_again_and_again_needs_maintenance() -> None:
    condition = Condition({"wheels": math.inf})
    condition.came("wheels")
    for number in range(5):
        assert condition.told(failed=False)["condition"] == "good"
        condition.heard(
            {"number": number, "kind": "measurement_error", "signal": "x", "reason": ""}
        )
    told = condition.told(failed=False)
    assert told["condition"] == "maintenance_required" and told["why"] == "look at the sensor of x"
