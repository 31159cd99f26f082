"""A lag behind a control valve that sticks."""

from __future__ import annotations

from functools import partial

import numpy as np
from machine import Columns, Machine, Numbers, measure, nominal
from plants import LEVEL_X, TANK_U, WARM_X
from scipy.signal import lfilter

from signals import all_wrong, clock, log_uniform, pick

NAME = "sticky"
TRUTH = "The valve sticks until the command is a band away, then breaks loose and jumps to it."


def own(roles: dict[str, str], inputs: Columns, start: Numbers, parameters: Numbers) -> Columns:
    """Valve with breakaway band, then a first-order lag; start 'valve' is hidden."""
    t, u = inputs["t"], inputs[roles["u"]]
    band, seat = parameters["band"], start.get("valve", float(u[0]))
    place = np.empty(t.size)
    for row, command in enumerate(u.tolist()):
        if abs(command - seat) > band:
            seat = command
        place[row] = seat
    stay = float(np.exp(-(t[1] - t[0]) / parameters["tau"]))
    goal = (1.0 - stay) * (parameters["k"] * place + parameters["offset"])
    first = start[roles["x"]]
    path, _ = lfilter([1.0], [1.0, -stay], goal[:-1], zi=[stay * first])
    return {roles["x"]: np.concatenate(([first], path))}


def creeping(
    rng: np.random.Generator, t: np.ndarray, full: float, tau: float, band: float
) -> np.ndarray:
    """Small steps up and down, slow ramps and now and then a large step."""
    times, values = [0.0], [full * rng.uniform(0.3, 0.7)]
    while times[-1] < t[-1]:
        rest = times[-1] + rng.uniform(0.4, 1.5) * tau
        kind, side = rng.random(), float(rng.choice([-1.0, 1.0]))
        size = band * rng.uniform(0.3, 1.6) if kind < 0.7 else full * rng.uniform(0.15, 0.4)
        if not 0.05 * full < values[-1] + side * size < 0.95 * full:
            side = -side
        slow = rng.uniform(0.5, 2.0) * tau if rng.random() < 0.4 else 1e-9
        times += [rest, rest + slow]
        values += [values[-1], float(np.clip(values[-1] + side * size, 0.0, full))]
    return np.interp(t, times, values)


def draw(seed: int) -> Machine:
    """A plant of one seed."""
    rng = np.random.default_rng([10, seed])
    warm = rng.random() < 0.5
    word, unit, full = TANK_U[int(rng.choice([0, 1, 3, 4]))]
    roles = {"x": pick(rng, WARM_X if warm else LEVEL_X), "u": word}
    tau = log_uniform(rng, 4.0, 30.0)
    rate = float(np.clip(np.round(50.0 / tau), 2, 10))
    span = log_uniform(rng, 20.0, 300.0) if warm else log_uniform(rng, 0.5, 5.0)
    true = {
        "k": span / full,
        "tau": tau,
        "band": full * rng.uniform(0.04, 0.12),
        "offset": rng.uniform(8.0, 28.0) if warm else span * rng.uniform(0.05, 0.2),
    }
    noise = {roles["x"]: true["k"] * true["band"] / log_uniform(rng, 18.0, 60.0)}
    form = partial(own, roles)
    inputs: list[Columns] = []
    starts: list[Numbers] = []
    for _ in range(int(rng.integers(5, 8))):
        t = clock(int(36.0 * tau * rate), rate)
        command = creeping(rng, t, full, tau, true["band"])
        settled = true["k"] * command[0] + true["offset"]
        inputs.append({"t": t, roles["u"]: command})
        starts.append(
            {roles["x"]: float(settled) + span * rng.uniform(-0.1, 0.1), "valve": float(command[0])}
        )
    recordings = measure(rng, form, true, inputs, starts, noise)
    textbook = {key: true[key] for key in ("k", "tau", "offset")}
    return Machine(
        nominal("tank", roles, all_wrong(rng, textbook)),
        recordings,
        [roles["u"]],
        [roles["x"]],
        {"t": "s", roles["x"]: "degC" if warm else "m", roles["u"]: unit},
        form,
        all_wrong(rng, true),
        true,
        noise,
        starts,
        tau,
    )
