"""``python -m evertwin.worlds.live.recorder arm|robot``: what a machine would publish, into files.

One topic goes into one file, several into files beside each other; a scan has a column for each
beam, ``ranges.1`` and so on. What the robot says goes into one bag where the file's name ends in
``.mcap``: the messages that it has in ROS, and its pictures, with what they show in
``NAME-objects.csv`` beside the bag. Nothing is waited for.

>>> paths_of(Path("run.csv"), ("command", "pose"))["pose"].name
'run-pose.csv'
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from evertwin.errors import EvertwinError
from evertwin.types import Vector
from evertwin.worlds.eye import save_rows
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.machines.robot import LiveRobot
from evertwin.worlds.live.making import machine_of, parser, samples_of
from evertwin.worlds.live.voices.ros_bag import save_bag
from evertwin.worlds.save import save


def paths_of(path: Path, topics: Iterable[str]) -> dict[str, Path]:
    """The file of each topic."""
    names = tuple(topics)
    if len(names) == 1:
        return {names[0]: path}
    return {name: path.with_name(f"{path.stem}-{name}{path.suffix}") for name in names}


def columns_of(samples: list[Sample], start: float) -> dict[str, Vector]:
    """Samples of one topic as columns; ``start``: of the machine's clock [s]."""
    columns = [one._replace(t=start + one.t).columns for one in samples]
    found: dict[str, Vector] = {}
    for name in columns[0]:
        values = np.array([one[name] for one in columns], dtype=float)
        listed = {f"{name}.{k + 1}": column for k, column in enumerate(values.T)}
        found |= listed if values.ndim > 1 else {name: values}
    return found


def main(arguments: list[str] | None = None) -> None:
    """Runs a machine for its seconds and writes what it said."""
    options = parser(__doc__)
    options.add_argument("--record", type=Path, required=True, help="file to write")
    given = options.parse_args(arguments)
    machine = machine_of(given)
    kept = [one for several in samples_of(given, machine) for one in several]
    if given.machine == "robot" and given.record.suffix == ".mcap":
        start = given.start or 1.0  # in ROS a stamp of zero is none
        if isinstance(machine, LiveRobot) and given.camera:
            shots = [(round((start + t) * 1e9), one) for t, one in machine.shots]
            save_rows(given.record.with_name(f"{given.record.stem}-objects.csv"), shots)
        return save_bag(given.record, kept, start)
    for topic, path in paths_of(given.record, given.topics or machine.units).items():
        columns = columns_of([one for one in kept if one.topic == topic], given.start or 0.0)
        units = {"seq": "1", **machine.units[topic]}
        save(
            path, columns, {name: units[name.partition(".")[0]] for name in columns if name != "t"}
        )


if __name__ == "__main__":
    try:
        main()
    except (EvertwinError, OSError) as error:
        sys.exit(f"{error}")
