"""A cart behind a gear with backlash."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import cart_columns

from signals import all_wrong, clock, log_uniform, shuttle, wrong

NAME = "backlash"
TRUTH = "The gear has play: after each reversal the motor crosses a gap before the cart follows."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Play operator on the motor's travel; start 'seat' is 1 on the forward flank, 0 behind."""
    t, speed = inputs["t"], parameters["gain"] * inputs[roles["v"]]
    gap = abs(parameters["gap"])
    travel = np.concatenate(([0.0], np.cumsum(speed[:-1] * np.diff(t))))
    cart = start[roles["x"]]
    motor = cart + start.get("seat", 1.0) * gap + travel
    path = np.empty(t.size)
    for row, place in enumerate(motor.tolist()):
        cart = min(max(cart, place - gap), place)
        path[row] = cart
    return {roles["x"]: path}


def draw(seed: int) -> Machine:
    """A cart of one seed."""
    rng = np.random.default_rng([1, seed])
    roles, units, scale = cart_columns(rng)
    rate = float(rng.choice([20, 25, 50]))
    count, seconds = int(rng.integers(5, 8)), 2200.0 / rate
    top = scale * log_uniform(rng, 0.05, 1.0)
    true = {"gain": rng.uniform(0.8, 1.2), "gap": top * log_uniform(rng, 0.03, 0.15)}
    noise = {roles["x"]: true["gap"] / log_uniform(rng, 9.0, 30.0)}
    form = partial(own, roles)
    inputs: list[Columns] = []
    for _ in range(count):
        t = clock(int(seconds * rate), rate)
        speed = shuttle(
            rng, t, top * np.array([0.25, 0.5, 0.75, 1.0]), (0.5, 2.5), (0.1, 0.5), (0.2, 1.5)
        )
        inputs.append({"t": t, roles["v"]: speed})
    starts = [{roles["x"]: top * rng.uniform(-1, 1), "seat": 1.0} for _ in range(count)]
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
