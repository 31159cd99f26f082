"""The plain part of the plants: column names, units and motions per textbook form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from machine import Columns, Numbers

from signals import clock, log_uniform, pick, profile, shuttle

CART_X = ("x", "pos", "axis_position", "carriage_pos", "slide_x", "act_pos")
CART_V = ("v_cmd", "speed_ref", "cmd_velocity", "v_set", "target_speed")
BASE_V = ("v", "cmd_vel_linear", "v_ref", "forward_speed", "lin_cmd")
BASE_W = ("w", "cmd_vel_angular", "omega_ref", "turn_rate", "yaw_cmd")
BASE_POSE = (
    ("x", "y", "heading"),
    ("pos_x", "pos_y", "yaw"),
    ("px", "py", "theta"),
    ("map_x", "map_y", "psi"),
    ("east", "north", "phi"),
)
DRIVE_MOTION = (
    ("q", "qd", "qdd"),
    ("pos", "vel", "acc"),
    ("position", "velocity", "accel"),
    ("act_pos", "act_speed", "act_acc"),
)
LINEAR_FORCE = ("force", "F_motor", "thrust", "drive_force")
ROTARY_FORCE = ("torque", "tau_motor", "M_drive", "shaft_torque")
TANK_U = (
    ("valve", "%", 100.0),
    ("u", "1", 1.0),
    ("heater_duty", "%", 100.0),
    ("ctrl_out", "V", 10.0),
    ("feed_cmd", "mA", 20.0),
)
WARM_X = ("temp", "T_out", "oven_temp", "pv", "temperature_1")
LEVEL_X = ("level", "h_tank", "fill", "lt_101", "tank_level")


@dataclass(frozen=True)
class Axis:
    """A drive axis: names, units, size, and its true and measured motion."""

    roles: dict[str, str]
    units: dict[str, str]
    top: float  # top speed
    rise: float  # a typical acceleration
    motion: list[Columns]


def cart_columns(rng: np.random.Generator) -> tuple[dict[str, str], dict[str, str], float]:
    """Roles, units and the number of length units in a metre of a cart."""
    roles = {"x": pick(rng, CART_X), "v": pick(rng, CART_V)}
    length, scale = (("m", 1.0), ("mm", 1000.0), ("cm", 100.0))[int(rng.integers(3))]
    units = {"t": "s", roles["x"]: length, roles["v"]: f"{length}/s"}
    return roles, units, scale


def base_columns(rng: np.random.Generator) -> tuple[dict[str, str], dict[str, str]]:
    """Roles and units of a planar differential robot."""
    x, y, heading = BASE_POSE[int(rng.integers(len(BASE_POSE)))]
    roles = {"v": pick(rng, BASE_V), "w": pick(rng, BASE_W), "x": x, "y": y, "heading": heading}
    units = {"t": "s", roles["v"]: "m/s", roles["w"]: "rad/s", x: "m", y: "m", heading: "rad"}
    return roles, units


def base_poses(rng: np.random.Generator, roles: dict[str, str], count: int) -> list[Numbers]:
    """Start poses, one per recording."""
    return [
        {
            roles["x"]: rng.uniform(-3, 3),
            roles["y"]: rng.uniform(-3, 3),
            roles["heading"]: rng.uniform(-3, 3),
        }
        for _ in range(count)
    ]


def base_path(
    t: np.ndarray,
    speed: np.ndarray,
    turn: np.ndarray,
    slide: np.ndarray,
    start: tuple[float, float, float],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose for speeds and turn rates held from row to row; `slide` angles the travel off."""
    dt = np.diff(t)
    bend = turn[:-1] * dt
    heading = start[2] + np.concatenate(([0.0], np.cumsum(bend)))
    chord = speed[:-1] * dt * np.sinc(bend / (2.0 * np.pi))
    along = heading[:-1] + 0.5 * bend + slide[:-1]
    x = start[0] + np.concatenate(([0.0], np.cumsum(chord * np.cos(along))))
    y = start[1] + np.concatenate(([0.0], np.cumsum(chord * np.sin(along))))
    return x, y, heading


def draw_axis(
    rng: np.random.Generator,
    levels: np.ndarray,
    count: int,
    seconds: float,
    rate: float,
    move: tuple[float, float] = (1.0, 3.5),
) -> Axis:
    """An axis that shuttles at shares `levels` of its top speed."""
    linear = rng.random() < 0.5
    pos, vel, acc = DRIVE_MOTION[int(rng.integers(len(DRIVE_MOTION)))]
    roles = {
        "pos": pos,
        "vel": vel,
        "acc": acc,
        "force": pick(rng, LINEAR_FORCE if linear else ROTARY_FORCE),
    }
    length = "m" if linear else "rad"
    units = {
        "t": "s",
        pos: length,
        vel: f"{length}/s",
        acc: f"{length}/s^2",
        roles["force"]: "N" if linear else "N m",
    }
    top = log_uniform(rng, 0.1, 2.0) if linear else log_uniform(rng, 1.0, 60.0)
    ramp = rng.uniform(0.25, 0.6)
    motion = []
    for _ in range(count):
        t = clock(int(seconds * rate), rate)
        speed = shuttle(rng, t, top * levels, move, (0.7 * ramp, 1.5 * ramp), (0.2, 1.0))
        width = max(3, int(0.08 * rate))
        speed = np.convolve(speed, np.ones(width) / width, mode="same")
        speed[np.abs(speed) < 1e-9 * top] = 0.0
        place = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) / rate)))
        motion.append({"t": t, pos: place, vel: speed, acc: np.gradient(speed, t)})
    return Axis(roles, units, top, top / ramp, motion)


def seen_axis(
    rng: np.random.Generator, axis: Axis, recordings: list[Columns], acc_noise: float
) -> list[Columns]:
    """Put small sensor noise on the motion; at a stop the encoder reports exact zeros."""
    pos, vel, acc = (axis.roles[role] for role in ("pos", "vel", "acc"))
    seen = []
    for recording in recordings:
        moving = recording[vel] != 0.0
        noise = {pos: 1e-5 * axis.top, vel: 1e-3 * np.abs(recording[vel]), acc: acc_noise}
        extra = {
            name: recording[name] + moving * rng.normal(0.0, sigma, moving.size)
            for name, sigma in noise.items()
        }
        seen.append({**recording, **extra})
    return seen


def base_commands(
    rng: np.random.Generator,
    roles: dict[str, str],
    t: np.ndarray,
    top: float,
    turn: float,
    ramp: tuple[float, float],
) -> Columns:
    """Persisting speeds with ramps and stops, and arcs of several radii."""
    speed = profile(rng, t, top * np.array([0.0, 0.35, 0.6, 0.8, 1.0, -0.5]), (1.0, 4.0), ramp)
    arc = profile(
        rng, t, turn * np.array([0.0, 0.4, -0.4, 0.7, -0.7, 1.0, -1.0]), (1.5, 5.0), (0.1, 0.4)
    )
    return {"t": t, roles["v"]: speed, roles["w"]: arc}
