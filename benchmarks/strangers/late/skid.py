"""A mobile robot that slides outward in curves."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import base_columns, base_commands, base_path, base_poses

from signals import all_wrong, clock, log_uniform

NAME = "skid"
TRUTH = "In curves the robot drifts outward by an angle that grows with speed times turn rate."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """The travel points off the heading by -skid * v * w (towards the outside when forward)."""
    t, speed, turn = inputs["t"], inputs[roles["v"]], inputs[roles["w"]]
    names = (roles["x"], roles["y"], roles["heading"])
    x, y, heading = base_path(
        t,
        parameters["gv"] * speed,
        parameters["gw"] * turn,
        -parameters["skid"] * speed * turn,
        (start[names[0]], start[names[1]], start[names[2]]),
    )
    return dict(zip(names, (x, y, heading), strict=True))


def draw(seed: int) -> Machine:
    """A robot of one seed."""
    rng = np.random.default_rng([4, seed])
    roles, units = base_columns(rng)
    rate = float(rng.choice([10, 20, 25, 50]))
    count, rows = int(rng.integers(5, 9)), 1600
    top, turn = log_uniform(rng, 0.3, 2.5), rng.uniform(0.5, 1.2)
    angle = rng.uniform(0.15, 0.45)
    true = {
        "gv": rng.uniform(0.85, 1.15),
        "gw": rng.uniform(0.85, 1.15),
        "skid": angle / (top * turn),
    }
    place = 0.5 * top * angle / log_uniform(rng, 5.0, 20.0)
    noise = {roles["x"]: place, roles["y"]: place, roles["heading"]: rng.uniform(0.002, 0.01)}
    form = partial(own, roles)
    inputs = [
        base_commands(rng, roles, clock(rows, rate), top, turn, (0.3, 1.2)) for _ in range(count)
    ]
    starts = base_poses(rng, roles, count)
    recordings = measure(rng, form, true, inputs, starts, noise)
    textbook = all_wrong(rng, {"gv": true["gv"], "gw": true["gw"]})
    return Machine(
        nominal("base", roles, textbook),
        recordings,
        [roles["v"], roles["w"]],
        [roles["x"], roles["y"], roles["heading"]],
        units,
        form,
        all_wrong(rng, true),
        true,
        noise,
        starts,
        4.0,
    )
