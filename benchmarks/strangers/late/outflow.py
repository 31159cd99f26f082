"""A tank that drains through an orifice."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import LEVEL_X, TANK_U

from signals import all_wrong, clock, log_uniform, pick, profile

NAME = "outflow"
TRUTH = "The tank drains through an orifice: the outflow grows with the root of the level."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """level' = fill * u - drain * sqrt(level), by Heun steps of a quarter row; no hidden start."""
    t, feed = inputs["t"], parameters["fill"] * inputs[roles["u"]]
    drain, step = parameters["drain"], 0.25 * float(t[1] - t[0])
    level, path = start[roles["x"]], np.empty(t.size)
    for row, flow in enumerate(feed.tolist()):
        path[row] = level
        for _ in range(4):
            slope = flow - drain * max(level, 0.0) ** 0.5
            later = flow - drain * max(level + step * slope, 0.0) ** 0.5
            level = max(level + 0.5 * step * (slope + later), 0.0)
    return {roles["x"]: path}


def draw(seed: int) -> Machine:
    """A tank of one seed."""
    rng = np.random.default_rng([8, seed])
    word, unit, full = TANK_U[int(rng.choice([0, 1, 3, 4]))]
    roles = {"x": pick(rng, LEVEL_X), "u": word}
    length, scale = (("m", 1.0), ("cm", 100.0), ("mm", 1000.0))[int(rng.integers(3))]
    tau = log_uniform(rng, 5.0, 40.0)  # time constant at half level
    rate = float(np.clip(np.round(60.0 / tau), 2, 10))
    top = scale * log_uniform(rng, 0.3, 4.0)
    drain = float(2.0 * np.sqrt(0.5 * top) / tau)
    true = {"fill": float(drain * np.sqrt(top) / full), "drain": drain}
    noise = {roles["x"]: top * 0.04 / log_uniform(rng, 4.0, 14.0)}
    form = partial(own, roles)
    count = int(rng.integers(5, 8))
    inputs: list[Columns] = []
    for _ in range(count):
        t = clock(int(26.0 * tau * rate), rate)
        levels = full * np.array([0.15, 0.3, 0.45, 0.6, 0.8, 1.0])
        flow = profile(
            rng, t, levels, (0.7 * tau, 3.0 * tau), (0.0, 0.3 * tau), float(rng.choice(levels))
        )
        inputs.append({"t": t, roles["u"]: flow})
    starts = [{roles["x"]: top * rng.uniform(0.05, 0.9)} for _ in range(count)]
    recordings = measure(rng, form, true, inputs, starts, noise)
    textbook = {"k": 2.0**0.5 * top / full, "tau": tau, "offset": -0.5 * top}
    return Machine(
        nominal("tank", roles, all_wrong(rng, textbook)),
        recordings,
        [roles["u"]],
        [roles["x"]],
        {"t": "s", roles["x"]: length, roles["u"]: unit},
        form,
        all_wrong(rng, true),
        true,
        noise,
        starts,
        tau,
    )
