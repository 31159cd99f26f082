"""A drive with more dry friction one way than the other."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import draw_axis, seen_axis

from signals import all_wrong, log_uniform

NAME = "direction"
TRUTH = "The seal drags harder one way: dry friction differs between forward and backward."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Dry friction is Fc_up forward, Fc_down backward and none at a stop; no hidden start."""
    vel = inputs[roles["vel"]]
    dry = np.where(vel > 0.0, parameters["Fc_up"], parameters["Fc_down"]) * np.sign(vel)
    return {
        roles["force"]: parameters["M"] * inputs[roles["acc"]]
        + parameters["Fv"] * vel
        + dry
        + parameters["offset"]
    }


def draw(seed: int) -> Machine:
    """A drive of one seed; moves are short, so that it often stands."""
    rng = np.random.default_rng([16, seed])
    rate = float(rng.choice([25, 50, 100]))
    levels = np.array([0.1, 0.25, 0.5, 0.75, 1.0])
    axis = draw_axis(rng, levels, int(rng.integers(4, 7)), 2800.0 / rate, rate, (0.3, 1.2))
    size = log_uniform(rng, 1.0, 300.0)  # mean dry friction
    half = size * rng.uniform(0.15, 0.5) * float(rng.choice([-1, 1]))
    true = {
        "M": size * rng.uniform(0.5, 2.0) / axis.rise,
        "Fv": size * rng.uniform(0.2, 1.0) / axis.top,
        "Fc_up": size + half,
        "Fc_down": size - half,
        "offset": size * rng.uniform(0.05, 0.3) * float(rng.choice([-1, 1])),
    }
    name = axis.roles["force"]
    noise = {name: 0.42 * abs(half) / log_uniform(rng, 3.5, 14.0)}
    form = partial(own, axis.roles)
    starts: list[Numbers] = [{} for _ in axis.motion]
    recordings = measure(rng, form, true, axis.motion, starts, noise)
    recordings = seen_axis(rng, axis, recordings, 0.15 * noise[name] / true["M"])
    textbook = {"M": true["M"], "Fv": true["Fv"], "Fc": size, "offset": true["offset"]}
    return Machine(
        nominal("drive", axis.roles, all_wrong(rng, textbook)),
        recordings,
        [axis.roles[role] for role in ("pos", "vel", "acc")],
        [name],
        axis.units,
        form,
        all_wrong(rng, true),
        true,
        noise,
        starts,
        3.0,
    )
