"""A drive whose dry friction is higher at creep speed."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import draw_axis, seen_axis

from signals import all_wrong, log_uniform, wrong

NAME = "stribeck"
TRUTH = "Dry friction is raised at creep speed and falls to its plain value as oil is drawn in."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Dry friction Fc + Fs * exp(-(vel / vs)^2), where Fs is the excess; no hidden start."""
    vel = inputs[roles["vel"]]
    dry = parameters["Fc"] + parameters["Fs"] * np.exp(-((vel / parameters["vs"]) ** 2))
    return {
        roles["force"]: parameters["M"] * inputs[roles["acc"]]
        + parameters["Fv"] * vel
        + dry * np.sign(vel)
        + parameters["offset"]
    }


def draw(seed: int) -> Machine:
    """A drive of one seed; half of its moves creep."""
    rng = np.random.default_rng([15, seed])
    rate = float(rng.choice([25, 50, 100]))
    levels = np.array([0.01, 0.025, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0])
    axis = draw_axis(rng, levels, int(rng.integers(4, 7)), 2800.0 / rate, rate)
    size = log_uniform(rng, 1.0, 300.0)  # plain dry friction
    true = {
        "M": size * rng.uniform(0.5, 2.0) / axis.rise,
        "Fv": size * rng.uniform(0.3, 1.2) / axis.top,
        "Fc": size,
        "offset": size * rng.uniform(0.05, 0.3) * float(rng.choice([-1, 1])),
        "Fs": size * rng.uniform(0.3, 1.0),
        "vs": axis.top * log_uniform(rng, 0.03, 0.12),
    }
    name = axis.roles["force"]
    noise = {name: 0.33 * true["Fs"] / log_uniform(rng, 3.5, 14.0)}
    form = partial(own, axis.roles)
    starts: list[Numbers] = [{} for _ in axis.motion]
    recordings = measure(rng, form, true, axis.motion, starts, noise)
    recordings = seen_axis(rng, axis, recordings, 0.15 * noise[name] / true["M"])
    textbook = {key: true[key] for key in ("M", "Fv", "Fc", "offset")}
    rough = {**all_wrong(rng, true), "vs": wrong(rng, true["vs"], (0.1, 0.5))}
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
