"""A mobile robot whose two motions disturb each other."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import base_columns, base_commands, base_path, base_poses

from signals import all_wrong, clock, log_uniform

NAME = "coupling"
TRUTH = "Driving turns the robot a little (even seeds), or turning costs it speed (odd seeds)."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Turn rate gw w + veer v, speed gv v - scrub |w|; an absent one is 0; no hidden start."""
    v, w = inputs[roles["v"]], inputs[roles["w"]]
    speed = parameters["gv"] * v - parameters.get("scrub", 0.0) * np.abs(w)
    turn = parameters["gw"] * w + parameters.get("veer", 0.0) * v
    names = (roles["x"], roles["y"], roles["heading"])
    pose = base_path(
        inputs["t"],
        speed,
        turn,
        np.zeros(v.size),
        (start[names[0]], start[names[1]], start[names[2]]),
    )
    return dict(zip(names, pose, strict=True))


def draw(seed: int) -> Machine:
    """A robot of one seed; one that loses speed drives forward only and turns while it drives."""
    rng = np.random.default_rng([14, seed])
    roles, units = base_columns(rng)
    rate = float(rng.choice([10, 20, 25, 50]))
    count, rows = int(rng.integers(5, 9)), 1600
    top, turn = log_uniform(rng, 0.2, 2.5), rng.uniform(0.5, 1.2)
    true = {"gv": rng.uniform(0.85, 1.15), "gw": rng.uniform(0.85, 1.15)}
    inputs = [
        base_commands(rng, roles, clock(rows, rate), top, turn, (0.3, 1.2)) for _ in range(count)
    ]
    clear = log_uniform(rng, 4.0, 13.0)  # how far the effect stands out of the noise
    if seed % 2 == 0:
        drift = log_uniform(rng, 0.02, 0.12) * float(rng.choice([-1, 1]))  # rad/s at top speed
        true["veer"] = drift / top
        place, angle = 1.2 * top * abs(drift) / clear, 1.1 * abs(drift) / clear
    else:
        share = rng.uniform(0.15, 0.4)
        true["scrub"] = share * top / turn
        place, angle = 0.35 * share * top / clear, rng.uniform(0.002, 0.01)
        for columns in inputs:
            columns[roles["v"]] = np.abs(columns[roles["v"]])
            columns[roles["w"]] *= np.minimum(2.0 * columns[roles["v"]] / top, 1.0)
    noise = {roles["x"]: place, roles["y"]: place, roles["heading"]: angle}
    form = partial(own, roles)
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
