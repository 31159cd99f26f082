"""A cart whose drive cannot go faster than a limit."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import cart_columns

from signals import all_wrong, clock, log_uniform, shuttle, wrong

NAME = "cap"
TRUTH = "The drive follows the command with its gain up to a top speed, and never exceeds that."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """x' = gain * v, cut off at +-cap (a speed of the cart); no hidden start."""
    t, cap = inputs["t"], abs(parameters["cap"])
    speed = np.clip(parameters["gain"] * inputs[roles["v"]], -cap, cap)
    travel = np.concatenate(([0.0], np.cumsum(speed[:-1] * np.diff(t))))
    return {roles["x"]: start[roles["x"]] + travel}


def draw(seed: int) -> Machine:
    """A cart of one seed; a good part of the moves asks for more than the limit."""
    rng = np.random.default_rng([12, seed])
    roles, units, scale = cart_columns(rng)
    rate = float(rng.choice([20, 25, 50]))
    count, rows = int(rng.integers(5, 8)), 2200
    top = scale * log_uniform(rng, 0.05, 1.5)
    gain, share = rng.uniform(0.8, 1.25), rng.uniform(0.45, 0.8)
    true = {"gain": gain, "cap": gain * top * share}
    noise = {roles["x"]: 0.35 * gain * top * (1.0 - share) / log_uniform(rng, 3.5, 14.0)}
    form = partial(own, roles)
    levels = top * np.array([0.2, 0.4, 0.6, 0.8, 0.9, 1.0])
    inputs: list[Columns] = []
    for _ in range(count):
        t = clock(rows, rate)
        speed = shuttle(rng, t, levels, (0.8, 3.0), (0.2, 0.8), (0.2, 1.2))
        inputs.append({"t": t, roles["v"]: speed})
    starts = [{roles["x"]: top * rng.uniform(-1, 1)} for _ in range(count)]
    recordings = measure(rng, form, true, inputs, starts, noise)
    return Machine(
        nominal("cart", roles, {"gain": wrong(rng, gain)}),
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
