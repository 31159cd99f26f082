"""A cart that does not move below a start threshold."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import cart_columns

from signals import all_wrong, clock, log_uniform, shuttle, wrong

NAME = "deadzone"
TRUTH = "The amplifier has a dead zone: only the part of the command beyond a threshold moves."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """x' = gain * (v less `dead`, towards zero), none within the zone; no hidden start."""
    t, v = inputs["t"], inputs[roles["v"]]
    speed = parameters["gain"] * np.sign(v) * np.maximum(np.abs(v) - parameters["dead"], 0.0)
    travel = np.concatenate(([0.0], np.cumsum(speed[:-1] * np.diff(t))))
    return {roles["x"]: start[roles["x"]] + travel}


def draw(seed: int) -> Machine:
    """A cart of one seed; some moves are commanded below the threshold."""
    rng = np.random.default_rng([11, seed])
    roles, units, scale = cart_columns(rng)
    rate = float(rng.choice([20, 25, 50]))
    count, rows = int(rng.integers(5, 8)), 2200
    top = scale * log_uniform(rng, 0.05, 1.5)
    share = rng.uniform(0.08, 0.25)
    true = {"gain": rng.uniform(0.8, 1.25), "dead": share * top}
    noise = {roles["x"]: 0.4 * true["dead"] / log_uniform(rng, 3.0, 11.0)}
    form = partial(own, roles)
    levels = top * np.array([0.6 * share, 1.3 * share, 2.0 * share, 0.6, 1.0])
    inputs: list[Columns] = []
    for _ in range(count):
        t = clock(rows, rate)
        speed = shuttle(rng, t, levels, (0.8, 3.0), (0.2, 0.8), (0.2, 1.2))
        inputs.append({"t": t, roles["v"]: speed})
    starts = [{roles["x"]: top * rng.uniform(-1, 1)} for _ in range(count)]
    recordings = measure(rng, form, true, inputs, starts, noise)
    return Machine(
        nominal("cart", roles, {"gain": wrong(rng, true["gain"])}),
        recordings,
        [roles["v"]],
        [roles["x"]],
        units,
        form,
        all_wrong(rng, true),
        true,
        noise,
        starts,
        3.0,
    )
