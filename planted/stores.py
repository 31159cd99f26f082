"""Machines that are known by a recording alone: ovens and winches, drawn by seed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np


class Machine(NamedTuple):
    """A recording, and what is true of its machine."""

    heading: str
    columns: np.ndarray
    step: float
    """From row to row [s]."""
    changed: int
    """Row from which on its number is ``share`` of what it was."""
    share: float


def oven(seed: int, *, healthy: bool = False, rows: int = 6000) -> Machine:
    """A heater warms an oven, which loses heat to the room, from a row on otherwise."""
    rng = np.random.default_rng([1, seed])
    step, slow = rng.choice([1.0, 5.0, 10.0, 30.0]), rng.uniform(150.0, 900.0)
    capacity = rng.uniform(300.0, 1200.0) * step
    loss = capacity / (step * slow)
    power, own = loss * rng.uniform(40.0, 250.0), capacity * rng.uniform(0.05, 0.4)
    into, noise = loss * rng.uniform(3.0, 15.0), rng.choice([0.02, 0.1, 0.3])
    digit, hold = rng.choice([0.01, 0.1]), int(rng.choice([60, 150, 400]))
    duty = np.repeat(rng.choice([0.0, 0.25, 0.5, 0.75, 1.0], rows // hold + 1), hold)[:rows]
    room = 21.0 + rng.uniform(0.0, 3.0) * np.sin(np.arange(rows) / rng.uniform(400.0, 2500.0))
    share = 1.0 if healthy else float(rng.choice([0.7, 1.35]))
    at, warm, heater = int(0.6 * rows), np.full(rows, room[0]), float(room[0])
    for k in range(1, rows):
        now, flow = loss * (share if k >= at else 1.0), into * (heater - warm[k - 1])
        warm[k] = warm[k - 1] + step * (flow - now * (warm[k - 1] - room[k - 1])) / capacity
        heater += step * (power * duty[k - 1] - flow) / own
    seen = (np.round((c + rng.normal(0.0, noise, rows)) / digit) * digit for c in (room, warm))
    columns = np.column_stack([step * np.arange(rows), 100.0 * duty, *seen])
    heading = "time [s],heater [%],ambient [degC],oven temp [degC]"
    return Machine(heading, columns, float(step), at, share)


def winch(seed: int, *, healthy: bool = False, rows: int = 9000) -> Machine:
    """A drive behind a converter: a ramp, a lag, a dead zone; from a row on another gain."""
    rng = np.random.default_rng([2, seed])
    step, top = rng.choice([0.02, 0.05, 0.1]), rng.uniform(20.0, 60.0)
    gain, ramp = rng.uniform(0.2, 3.0) / top, top * rng.choice([0.3, 1.0, 3.0, 1e9])
    lag, dead = rng.choice([0.0, 0.1, 0.3]), top * rng.choice([0.0, 0.0, 0.08])
    hold = int(rng.uniform(3.0, 9.0) / step)
    asked = np.repeat(np.round(rng.uniform(-1.0, 1.0, rows // hold + 1) * top), hold)[:rows]
    share = 1.0 if healthy else float(rng.choice([0.85, 0.75, 1.2]))
    at, place, set_, speed = int(0.6 * rows), np.zeros(rows), 0.0, 0.0
    for k in range(1, rows):
        set_ += float(np.clip(asked[k - 1] - set_, -ramp * step, ramp * step))
        wanted = gain * (share if k >= at else 1.0) * (set_ if abs(set_) >= dead else 0.0)
        speed += (wanted - speed) * (min(1.0, step / lag) if lag else 1.0)
        place[k] = place[k - 1] + step * speed
    noise = rng.choice([0.0005, 0.002, 0.01])
    seen = np.round(1e3 * (place + rng.normal(0.0, noise, rows)))
    columns = np.column_stack([step * np.arange(rows), asked, seen])
    return Machine("t [s],f_set [Hz],pos [mm]", columns, float(step), at, share)


def elastic(seed: int, rows: int = 9000) -> np.ndarray:
    """Time [s], place of a load on an elastic rope [m], and force of the drum that is driven to a
    speed which changes at random [N], (rows, 3)."""
    rng, step, sub = np.random.default_rng([3, seed]), 0.02, 10
    inertia, mass, stiff, damped = 35.0, 60.0, 4e4, 400.0  # at the rope [kg, kg, N/m, Ns/m]
    asked = np.repeat(rng.uniform(-0.45, 0.45, rows), rng.integers(60, 220, rows))[:rows]
    speed, drum, load, sinks, h = 0.0, 0.0, -mass * 9.81 / stiff, 0.0, step / sub
    place, force = np.empty(rows), np.empty(rows)
    for k in range(rows):
        goal = asked[k] if abs(drum) < 4.0 or asked[k] * drum < 0.0 else -0.2 * np.sign(drum)
        force[k] = mass * 9.81 + 550.0 * (goal - speed) + rng.normal(0.0, 2.0)
        for _ in range(sub):
            pull = stiff * (drum - load) + damped * (speed - sinks)
            rubs = 60.0 * math.tanh(speed / 0.003) + 130.0 * speed
            speed += h * (force[k] - pull - rubs) / inertia
            drum += h * speed
            sinks += h * (pull / mass - 9.81)
            load += h * sinks
        place[k] = load
    seen = place + rng.normal(0.0, 0.002, rows)
    return np.column_stack([step * np.arange(rows), seen, force])


def record(machine: Machine, file: Path) -> None:
    """The recording as a table."""
    np.savetxt(file, machine.columns, "%.8g", ",", header=machine.heading, comments="")
