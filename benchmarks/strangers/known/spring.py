"""A drive with a spring counterbalance."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import draw_axis, seen_axis

from signals import all_wrong, log_uniform

NAME = "spring"
TRUTH = "A spring counterbalance pulls at the axis with a force proportional to position."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """The textbook force plus stiff * pos (stiff < 0: a pull outward); no hidden start."""
    pos, vel = inputs[roles["pos"]], inputs[roles["vel"]]
    return {
        roles["force"]: parameters["M"] * inputs[roles["acc"]]
        + parameters["Fv"] * vel
        + parameters["Fc"] * np.sign(vel)
        + parameters["offset"]
        + parameters["stiff"] * pos
    }


def draw(seed: int) -> Machine:
    """A drive of one seed."""
    rng = np.random.default_rng([17, seed])
    rate = float(rng.choice([25, 50, 100]))
    levels = np.array([0.15, 0.3, 0.6, 1.0])
    axis = draw_axis(rng, levels, int(rng.integers(4, 7)), 2800.0 / rate, rate)
    size = log_uniform(rng, 1.0, 300.0)  # dry friction
    spread = float(np.std(np.concatenate([columns[axis.roles["pos"]] for columns in axis.motion])))
    true = {
        "M": size * rng.uniform(0.5, 2.0) / axis.rise,
        "Fv": size * rng.uniform(0.2, 1.0) / axis.top,
        "Fc": size,
        "offset": size * rng.uniform(0.2, 1.5) * float(rng.choice([-1, 1])),
        "stiff": size * rng.uniform(0.2, 1.0) / spread * float(rng.choice([1, 1, -1])),
    }
    name = axis.roles["force"]
    noise = {name: abs(true["stiff"]) * spread / log_uniform(rng, 3.5, 14.0)}
    form = partial(own, axis.roles)
    starts: list[Numbers] = [{} for _ in axis.motion]
    recordings = measure(rng, form, true, axis.motion, starts, noise)
    recordings = seen_axis(rng, axis, recordings, 0.15 * noise[name] / true["M"])
    textbook = {key: true[key] for key in ("M", "Fv", "Fc", "offset")}
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
