"""A drive with a bent screw or an eccentric wheel."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import draw_axis, seen_axis

from signals import all_wrong, log_uniform, wrong

NAME = "bent"
TRUTH = "The screw is bent: dry friction rises and falls once per turn along the travel."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Fc is multiplied by 1 + swell * sin(2 pi pos / pitch + phase); no hidden start."""
    vel = inputs[roles["vel"]]
    turn = 2.0 * np.pi * inputs[roles["pos"]] / parameters["pitch"] + parameters["phase"]
    dry = parameters["Fc"] * (1.0 + parameters["swell"] * np.sin(turn))
    return {
        roles["force"]: parameters["M"] * inputs[roles["acc"]]
        + parameters["Fv"] * vel
        + dry * np.sign(vel)
        + parameters["offset"]
    }


def draw(seed: int) -> Machine:
    """A drive of one seed."""
    rng = np.random.default_rng([7, seed])
    rate = float(rng.choice([25, 50, 100]))
    levels = np.array([0.15, 0.3, 0.6, 1.0])
    axis = draw_axis(rng, levels, int(rng.integers(4, 7)), 2800.0 / rate, rate)
    size = log_uniform(rng, 1.0, 300.0)  # dry friction
    reach = max(float(np.ptp(columns[axis.roles["pos"]])) for columns in axis.motion)
    true = {
        "M": size * rng.uniform(0.5, 2.0) / axis.rise,
        "Fv": size * rng.uniform(0.3, 1.0) / axis.top,
        "Fc": size,
        "offset": size * rng.uniform(0.05, 0.3),
        "swell": rng.uniform(0.2, 0.6),
        "pitch": reach / rng.uniform(2.0, 6.0),
        "phase": rng.uniform(-3.0, 3.0),
    }
    name = axis.roles["force"]
    noise = {name: size * 0.65 * true["swell"] / log_uniform(rng, 3.0, 14.0)}
    form = partial(own, axis.roles)
    starts: list[Numbers] = [{} for _ in axis.motion]
    recordings = measure(rng, form, true, axis.motion, starts, noise)
    recordings = seen_axis(rng, axis, recordings, 0.15 * noise[name] / true["M"])
    textbook = {key: true[key] for key in ("M", "Fv", "Fc", "offset")}
    rough = {
        **all_wrong(rng, true),
        "pitch": wrong(rng, true["pitch"], (0.01, 0.03)),
        "phase": true["phase"] + rng.uniform(-0.5, 0.5),
    }
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
