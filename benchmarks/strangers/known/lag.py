"""A cart whose speed follows the command with a lag."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import cart_columns

from signals import all_wrong, clock, log_uniform, shuttle, wrong

NAME = "lag"
TRUTH = "The speed approaches the commanded one with a first-order lag."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """speed' = (gain * v - speed) / tau and x' = speed, exactly; start 'speed' is hidden."""
    t, tau = inputs["t"], parameters["tau"]
    dt = float(t[1] - t[0])
    stay = float(np.exp(-dt / tau))
    place, speed, path = start[roles["x"]], start.get("speed", 0.0), np.empty(t.size)
    for row, goal in enumerate((parameters["gain"] * inputs[roles["v"]]).tolist()):
        path[row] = place
        place += goal * dt + (speed - goal) * tau * (1.0 - stay)
        speed = goal + stay * (speed - goal)
    return {roles["x"]: path}


def draw(seed: int) -> Machine:
    """A cart of one seed; recordings begin at rest or while it still coasts."""
    rng = np.random.default_rng([13, seed])
    roles, units, scale = cart_columns(rng)
    rate = float(rng.choice([20, 25, 50]))
    count, rows = int(rng.integers(5, 8)), 2400
    top = scale * log_uniform(rng, 0.05, 1.5)
    tau = log_uniform(rng, 0.3, 2.0)
    true = {"gain": rng.uniform(0.8, 1.25), "tau": tau}
    noise = {roles["x"]: 0.4 * top * tau / (1.0 + 0.5 * tau) / log_uniform(rng, 3.5, 12.0)}
    form = partial(own, roles)
    inputs: list[Columns] = []
    starts: list[Numbers] = []
    for _ in range(count):
        t = clock(rows, rate)
        speed = shuttle(
            rng, t, top * np.array([0.25, 0.5, 0.75, 1.0]), (1.0, 4.0), (0.0, 0.5), (0.3, 2.0)
        )
        inputs.append({"t": t, roles["v"]: speed})
        coast = top * rng.uniform(-0.5, 0.5) if rng.random() < 0.3 else 0.0
        starts.append({roles["x"]: top * rng.uniform(-1, 1), "speed": coast})
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
