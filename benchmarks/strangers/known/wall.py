"""A heated chamber with a heavy wall."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import TANK_U, WARM_X
from scipy.linalg import expm

from signals import all_wrong, clock, log_uniform, pick, profile

NAME = "wall"
TRUTH = "A heavy wall, whose temperature is not measured, stores heat and gives it back slowly."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """x' = (k u + offset - x + share (wall - x)) / tau and wall' = (x - wall) / slow, exactly.

    Start 'wall' is hidden; by default the wall is as warm as the measured store.
    """
    t, tau, share = inputs["t"], parameters["tau"], parameters["share"]
    goal = parameters["k"] * inputs[roles["u"]] + parameters["offset"]
    flow = np.zeros((3, 3))  # states: measured store, wall, goal
    flow[0] = np.array([-1.0 - share, share, 1.0]) / tau
    flow[1, :2] = np.array([1.0, -1.0]) / parameters["slow"]
    (a, b, c), (d, e, f), _ = expm(flow * float(t[1] - t[0])).tolist()
    store, path = start[roles["x"]], np.empty(t.size)
    wall = start.get("wall", store)
    for row, target in enumerate(goal.tolist()):
        path[row] = store
        store, wall = a * store + b * wall + c * target, d * store + e * wall + f * target
    return {roles["x"]: path}


def draw(seed: int) -> Machine:
    """A chamber of one seed; holds last both shorter and longer than the wall is slow."""
    rng = np.random.default_rng([18, seed])
    word, unit, full = TANK_U[int(rng.choice([1, 2, 3, 4]))]
    roles = {"x": pick(rng, WARM_X), "u": word}
    tau = log_uniform(rng, 5.0, 60.0)
    rate = float(np.clip(np.round(60.0 / tau), 1, 10))
    span = log_uniform(rng, 15.0, 400.0)
    true = {
        "k": span / full,
        "tau": tau,
        "offset": rng.uniform(8.0, 28.0),
        "share": rng.uniform(0.5, 1.5),
        "slow": tau * rng.uniform(2.5, 7.0),
    }
    noise = {roles["x"]: span * 0.05 * true["share"] / log_uniform(rng, 6.0, 20.0)}
    form = partial(own, roles)
    levels = full * np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    inputs: list[Columns] = []
    starts: list[Numbers] = []
    for _ in range(int(rng.integers(5, 8))):
        t = clock(int(36.0 * tau * rate), rate)
        duty = profile(
            rng, t, levels, (0.8 * tau, 9.0 * tau), (0.0, 0.2 * tau), float(rng.choice(levels))
        )
        inputs.append({"t": t, roles["u"]: duty})
        warm = true["offset"] + span * rng.uniform(0.1, 0.8)
        starts.append({roles["x"]: warm, "wall": warm + span * rng.uniform(-0.15, 0.15)})
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
