"""A heater whose warm air travels through a duct."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import TANK_U, WARM_X
from scipy.signal import lfilter

from signals import all_wrong, clock, log_uniform, pick, profile

NAME = "plug"
TRUTH = "Heat travels through a duct whose blower runs faster at high command: a varying delay."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Plug flow: what leaves the duct entered `volume` of blown air ago, then a first-order lag.

    The blower moves idle + u per second; before the first row the command stood still.
    """
    t, u = inputs["t"], inputs[roles["u"]]
    dt = float(t[1] - t[0])
    blow = np.maximum(parameters["idle"] + u, 1e-9)
    moved = np.concatenate(([0.0], np.cumsum(blow * dt)))
    carried = np.concatenate(([0.0], np.cumsum(blow * u * dt)))
    past = moved - parameters["volume"]
    left = np.where(past < 0.0, past * u[0], np.interp(past, moved, carried))
    arriving = np.diff(left) / np.diff(moved)
    stay = float(np.exp(-dt / parameters["tau"]))
    goal = (1.0 - stay) * (parameters["k"] * arriving + parameters["offset"])
    first = start[roles["x"]]
    path, _ = lfilter([1.0], [1.0, -stay], goal[:-1], zi=[stay * first])
    return {roles["x"]: np.concatenate(([first], path))}


def draw(seed: int) -> Machine:
    """A heater of one seed."""
    rng = np.random.default_rng([9, seed])
    word, unit, full = TANK_U[int(rng.choice([1, 2, 3, 4]))]
    roles = {"x": pick(rng, WARM_X), "u": word}
    tau = log_uniform(rng, 5.0, 40.0)
    rate = float(np.clip(np.round(60.0 / tau), 2, 10))
    span = log_uniform(rng, 15.0, 300.0)
    idle = full * rng.uniform(0.15, 0.35)
    true = {
        "k": span / full,
        "tau": tau,
        "offset": rng.uniform(8.0, 28.0),
        "volume": tau * rng.uniform(0.2, 0.45) * (idle + 0.4 * full),
        "idle": idle,
    }
    noise = {roles["x"]: span * 0.06 / log_uniform(rng, 3.0, 12.0)}
    form = partial(own, roles)
    count = int(rng.integers(5, 8))
    inputs: list[Columns] = []
    for _ in range(count):
        t = clock(int(26.0 * tau * rate), rate)
        levels = full * np.array([0.05, 0.2, 0.4, 0.6, 0.8, 1.0])
        duty = profile(
            rng, t, levels, (0.6 * tau, 2.5 * tau), (0.0, 0.2 * tau), float(rng.choice(levels))
        )
        inputs.append({"t": t, roles["u"]: duty})
    starts = [{roles["x"]: true["offset"] + span * rng.uniform(0.1, 0.8)} for _ in range(count)]
    recordings = measure(rng, form, true, inputs, starts, noise)
    textbook = {key: true[key] for key in ("k", "tau", "offset")}
    return Machine(
        nominal("tank", roles, all_wrong(rng, textbook)),
        recordings,
        [roles["u"]],
        [roles["x"]],
        {"t": "s", roles["x"]: "degC", roles["u"]: unit},
        form,
        all_wrong(rng, true),
        true,
        noise,
        starts,
        tau,
    )
