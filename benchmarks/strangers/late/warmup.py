"""A drive whose friction falls as it runs warm."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import draw_axis, seen_axis

from signals import all_wrong, log_uniform, wrong

NAME = "warmup"
TRUTH = "Friction warms the bearing and a warm bearing has less friction; it cools at rest."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Friction / (1 + warmth); warmth' = heat * friction power - warmth / cool; hidden start."""
    t, vel = inputs["t"], inputs[roles["vel"]]
    cold = parameters["Fv"] * vel + parameters["Fc"] * np.sign(vel)
    dt = float(t[1] - t[0])
    stay, heat = float(np.exp(-dt / parameters["cool"])), dt * parameters["heat"]
    warmth, drag = start.get("warmth", 0.0), np.empty(t.size)
    for row, (friction, power) in enumerate(zip(cold.tolist(), (cold * vel).tolist())):
        drag[row] = friction / (1.0 + warmth)
        warmth = stay * warmth + heat * power / (1.0 + warmth)
    return {roles["force"]: parameters["M"] * inputs[roles["acc"]] + drag + parameters["offset"]}


def draw(seed: int) -> Machine:
    """A drive of one seed; every recording begins cold."""
    rng = np.random.default_rng([6, seed])
    rate = float(rng.choice([20, 25, 50]))
    levels = np.array([0.2, 0.4, 0.7, 1.0])
    axis = draw_axis(rng, levels, int(rng.integers(4, 6)), 3600.0 / rate, rate)
    size = log_uniform(rng, 1.0, 300.0)  # cold friction at top speed
    cool = rng.uniform(20.0, 60.0)
    true = {
        "M": size * rng.uniform(0.5, 2.0) / axis.rise,
        "Fv": 0.6 * size / axis.top,
        "Fc": 0.4 * size,
        "offset": size * rng.uniform(0.05, 0.2),
        "heat": rng.uniform(2.5, 6.0) / (cool * size * axis.top),
        "cool": cool,
    }
    name = axis.roles["force"]
    noise = {name: size * 0.1 / log_uniform(rng, 5.5, 16.0)}
    form = partial(own, axis.roles)
    starts: list[Numbers] = [{"warmth": 0.0} for _ in axis.motion]
    recordings = measure(rng, form, true, axis.motion, starts, noise)
    recordings = seen_axis(rng, axis, recordings, 0.15 * noise[name] / true["M"])
    textbook = {
        "M": true["M"],
        "Fv": 0.7 * true["Fv"],
        "Fc": 0.7 * true["Fc"],
        "offset": true["offset"],
    }
    rough = {**all_wrong(rng, true), "heat": wrong(rng, true["heat"], (0.1, 0.4))}
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
