"""A cart on a long, springy belt."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import cart_columns
from scipy.linalg import expm

from signals import all_wrong, clock, log_uniform, shuttle, wrong

NAME = "elastic"
TRUTH = "The belt is a spring: the cart swings about the motor's place before it settles."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Damped swing at `freq` (Hz) about the motor; start 'stretch' and 'rate' are hidden."""
    t, speed = inputs["t"], inputs[roles["v"]]
    swing, gain = 2.0 * np.pi * parameters["freq"], parameters["gain"]
    drag = 2.0 * parameters["damping"] * swing
    flow = np.zeros((3, 3))  # states: stretch (cart - motor), cart speed, motor speed
    flow[0, 1], flow[0, 2] = 1.0, -1.0
    flow[1] = (-(swing**2), -drag, drag)
    (a, b, c), (d, e, f), _ = expm(flow * float(t[1] - t[0])).tolist()
    stretch, rate = start.get("stretch", 0.0), start.get("rate", 0.0)
    offs = np.empty(t.size)
    for row, motor_speed in enumerate((gain * speed).tolist()):
        offs[row] = stretch
        stretch, rate = (
            a * stretch + b * rate + c * motor_speed,
            d * stretch + e * rate + f * motor_speed,
        )
    motor = np.concatenate(([0.0], np.cumsum(gain * speed[:-1] * np.diff(t))))
    return {roles["x"]: start[roles["x"]] - offs[0] + motor + offs}


def draw(seed: int) -> Machine:
    """A cart of one seed."""
    rng = np.random.default_rng([2, seed])
    roles, units, scale = cart_columns(rng)
    rate = float(rng.choice([25, 50, 100]))
    count, rows = int(rng.integers(5, 8)), 2400
    top = scale * log_uniform(rng, 0.1, 1.5)
    true = {
        "gain": rng.uniform(0.8, 1.2),
        "freq": log_uniform(rng, 0.5, 2.0),
        "damping": rng.uniform(0.05, 0.2),
    }
    size = top / (2.0 * np.pi * true["freq"])
    noise = {roles["x"]: size / log_uniform(rng, 12.0, 40.0)}
    form = partial(own, roles)
    inputs: list[Columns] = []
    for _ in range(count):
        t = clock(rows, rate)
        speed = shuttle(
            rng,
            t,
            top * np.array([0.4, 0.7, 1.0]),
            (0.8, 3.0),
            (0.0, 0.25 / true["freq"]),
            (0.5, 2.0),
        )
        inputs.append({"t": t, roles["v"]: speed})
    starts = [{roles["x"]: top * rng.uniform(-1, 1)} for _ in range(count)]
    recordings = measure(rng, form, true, inputs, starts, noise)
    rough = {**all_wrong(rng, true), "freq": wrong(rng, true["freq"], (0.03, 0.08))}
    return Machine(
        nominal("cart", roles, {"gain": wrong(rng, true["gain"])}),
        recordings,
        [roles["v"]],
        [roles["x"]],
        units,
        form,
        rough,
        true,
        noise,
        starts,
        3.0,
    )
