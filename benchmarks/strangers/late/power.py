"""A drive whose friction grows with a broken power of speed."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import draw_axis, seen_axis

from signals import all_wrong, log_uniform, wrong

NAME = "power"
TRUTH = "Grease friction grows with a power of speed well below one, steep at creep speed."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """M * acc + (Fc + Fp * |vel|^power) * sign(vel) + offset; no hidden start."""
    vel = inputs[roles["vel"]]
    drag = parameters["Fc"] + parameters["Fp"] * np.abs(vel) ** parameters["power"]
    return {
        roles["force"]: parameters["M"] * inputs[roles["acc"]]
        + drag * np.sign(vel)
        + parameters["offset"]
    }


def draw(seed: int) -> Machine:
    """A drive of one seed."""
    rng = np.random.default_rng([5, seed])
    rate = float(rng.choice([25, 50, 100]))
    levels = np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0])
    axis = draw_axis(rng, levels, int(rng.integers(4, 7)), 2800.0 / rate, rate)
    size = log_uniform(rng, 1.0, 300.0)  # power-law friction at top speed
    power = rng.uniform(0.3, 0.6)
    true = {
        "M": size * rng.uniform(0.5, 2.0) / axis.rise,
        "Fc": size * rng.uniform(0.1, 0.4),
        "Fp": size / axis.top**power,
        "power": power,
        "offset": size * rng.uniform(0.05, 0.3) * float(rng.choice([-1, 1])),
    }
    name = axis.roles["force"]
    noise = {name: size * 0.06 / log_uniform(rng, 3.0, 9.0)}
    form = partial(own, axis.roles)
    starts: list[Numbers] = [{} for _ in axis.motion]
    recordings = measure(rng, form, true, axis.motion, starts, noise)
    recordings = seen_axis(rng, axis, recordings, 0.15 * noise[name] / true["M"])
    textbook = {
        "M": true["M"],
        "Fv": 0.7 * size / axis.top,
        "Fc": true["Fc"] + 0.3 * size,
        "offset": true["offset"],
    }
    rough = {**all_wrong(rng, true), "power": wrong(rng, power, (0.1, 0.4))}
    return Machine(
        nominal("drive", axis.roles, all_wrong(rng, textbook)),
        recordings,
        [axis.roles[role] for role in ("pos", "vel", "acc")],
        [name],
        axis.units,
        form,
        rough,
        true,
        noise,
        starts,
        3.0,
    )
