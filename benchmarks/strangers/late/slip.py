"""A mobile robot whose wheels spin when it speeds up."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import base_columns, base_commands, base_path, base_poses

from signals import all_wrong, clock, log_uniform

NAME = "slip"
TRUTH = "While the robot speeds up its wheels slip, the more the harder it accelerates."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Travel shrinks by exp(-slip * acceleration) while the size of the speed grows."""
    t, speed = inputs["t"], inputs[roles["v"]]
    size = np.abs(speed)
    push = np.maximum(np.diff(size, prepend=size[:1]) / (t[1] - t[0]), 0.0)
    real = parameters["gv"] * speed * np.exp(-parameters["slip"] * push)
    names = (roles["x"], roles["y"], roles["heading"])
    x, y, heading = base_path(
        t,
        real,
        parameters["gw"] * inputs[roles["w"]],
        np.zeros(t.size),
        (start[names[0]], start[names[1]], start[names[2]]),
    )
    return dict(zip(names, (x, y, heading), strict=True))


def draw(seed: int) -> Machine:
    """A robot of one seed."""
    rng = np.random.default_rng([3, seed])
    roles, units = base_columns(rng)
    rate = float(rng.choice([10, 20, 25, 50]))
    count, rows = int(rng.integers(5, 9)), 1600
    top, turn = log_uniform(rng, 0.3, 2.5), rng.uniform(0.4, 1.2)
    ramp = rng.uniform(0.8, 1.4)
    share = rng.uniform(0.25, 0.5)
    true = {
        "gv": rng.uniform(0.85, 1.15),
        "gw": rng.uniform(0.85, 1.15),
        "slip": -float(np.log(1.0 - share)) * ramp / top,
    }
    place = 0.35 * top * ramp * share / log_uniform(rng, 12.0, 40.0)
    noise = {roles["x"]: place, roles["y"]: place, roles["heading"]: rng.uniform(0.002, 0.01)}
    form = partial(own, roles)
    inputs = [
        base_commands(rng, roles, clock(rows, rate), top, turn, (0.4 * ramp, 1.6 * ramp))
        for _ in range(count)
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
