"""Inverse dynamics of a serial arm by the recursive Newton-Euler algorithm, compiled.

Luh, Walker and Paul (1980), in the frames of the links. Each frame has its z axis on its joint's
axis, so a joint turns by two numbers, its cosine and sine. Forwards, from the base: angular
velocity ``w``, angular acceleration ``dw`` and acceleration ``a`` of each frame. Backwards: the
force ``f`` and the moment ``n`` that the joint must pass on. A link's inertia enters as the ten
numbers that the torque is linear in: mass, first moment (3), second moment about the frame's origin
(xx, xy, yy, xz, yz, zz).

Gravity is an acceleration of the base upwards. `joint_torques` is compared with Pinocchio in the
tests.
"""

from __future__ import annotations

import math
from typing import Any

from evertwin.compiled.functions import njit

JOINT = 13
"""Reals of a joint in ``geometry``, after three of gravity: rotation (9), position (3), slides?"""
BODY = 10
"""Reals of a link in ``inertia``."""
MOVED, WRENCH = 11, 6
"""Reals of a joint in working memory: how its frame moves (cosine, sine, w, dw, a), and its link's
force and moment."""
KEPT = MOVED + WRENCH


@njit(cache=True, inline="always")
def outwards(n: int, geometry: Any, u: Any, moved: Any) -> None:
    """How the frames of joints move, from the base; ``moved``, (11 n,), is filled."""
    wx = wy = wz = dx = dy = dz = 0.0
    ax, ay, az = -geometry[0], -geometry[1], -geometry[2]
    for i in range(n):
        g, k = 3 + JOINT * i, MOVED * i
        e0, e1, e2 = geometry[g], geometry[g + 1], geometry[g + 2]
        e3, e4, e5 = geometry[g + 3], geometry[g + 4], geometry[g + 5]
        e6, e7, e8 = geometry[g + 6], geometry[g + 7], geometry[g + 8]
        rx, ry, rz = geometry[g + 9], geometry[g + 10], geometry[g + 11]
        v, acc = u[n + i], u[2 * n + i]
        slides = geometry[g + 12] != 0.0
        if slides:
            c, s = 1.0, 0.0
            rx, ry, rz = rx + e2 * u[i], ry + e5 * u[i], rz + e8 * u[i]
        else:
            c, s = math.cos(u[i]), math.sin(u[i])
        # Acceleration of this frame's origin, still in the parent's frame.
        tx, ty, tz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
        px = ax + dy * rz - dz * ry + wy * tz - wz * ty
        py = ay + dz * rx - dx * rz + wz * tx - wx * tz
        pz = az + dx * ry - dy * rx + wx * ty - wy * tx
        # Into this frame: first the fixed rotation, then the joint's.
        tx, ty = e0 * px + e3 * py + e6 * pz, e1 * px + e4 * py + e7 * pz
        ax, ay, az = c * tx + s * ty, c * ty - s * tx, e2 * px + e5 * py + e8 * pz
        tx, ty = e0 * wx + e3 * wy + e6 * wz, e1 * wx + e4 * wy + e7 * wz
        wx, wy, wz = c * tx + s * ty, c * ty - s * tx, e2 * wx + e5 * wy + e8 * wz
        tx, ty = e0 * dx + e3 * dy + e6 * dz, e1 * dx + e4 * dy + e7 * dz
        dx, dy, dz = c * tx + s * ty, c * ty - s * tx, e2 * dx + e5 * dy + e8 * dz
        if slides:
            ax, ay, az = ax + 2.0 * wy * v, ay - 2.0 * wx * v, az + acc
        else:
            dx, dy, dz = dx + wy * v, dy - wx * v, dz + acc
            wz += v
        moved[k], moved[k + 1] = c, s
        moved[k + 2], moved[k + 3], moved[k + 4] = wx, wy, wz
        moved[k + 5], moved[k + 6], moved[k + 7] = dx, dy, dz
        moved[k + 8], moved[k + 9], moved[k + 10] = ax, ay, az


@njit(cache=True, inline="always")
def wrench(i: int, body: Any, b: int, moved: Any, forces: Any, f: int) -> None:
    """Force m·a + dw × h + w × (w × h) and moment I·dw + w × I·w + h × a at the origin of link
    ``i``, whose `BODY` reals begin at ``b``: six of ``forces``, from ``f`` on."""
    k = MOVED * i
    wx, wy, wz = moved[k + 2], moved[k + 3], moved[k + 4]
    dx, dy, dz = moved[k + 5], moved[k + 6], moved[k + 7]
    ax, ay, az = moved[k + 8], moved[k + 9], moved[k + 10]
    m, hx, hy, hz = body[b], body[b + 1], body[b + 2], body[b + 3]
    xx, xy, yy = body[b + 4], body[b + 5], body[b + 6]
    xz, yz, zz = body[b + 7], body[b + 8], body[b + 9]
    tx, ty, tz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
    forces[f] = m * ax + dy * hz - dz * hy + wy * tz - wz * ty
    forces[f + 1] = m * ay + dz * hx - dx * hz + wz * tx - wx * tz
    forces[f + 2] = m * az + dx * hy - dy * hx + wx * ty - wy * tx
    lx, ly = xx * wx + xy * wy + xz * wz, xy * wx + yy * wy + yz * wz
    lz = xz * wx + yz * wy + zz * wz
    forces[f + 3] = xx * dx + xy * dy + xz * dz + wy * lz - wz * ly + hy * az - hz * ay
    forces[f + 4] = xy * dx + yy * dy + yz * dz + wz * lx - wx * lz + hz * ax - hx * az
    forces[f + 5] = xz * dx + yz * dy + zz * dz + wx * ly - wy * lx + hx * ay - hy * ax


@njit(cache=True, inline="always")
def inwards(n: int, geometry: Any, u: Any, moved: Any, forces: Any, f: int, tau: Any) -> None:
    """What the first ``n`` joints pass on, from the last of them to the base: ``tau``, (n,). The
    wrenches of their links stand in ``forces`` from ``f`` on."""
    fx = fy = fz = nx = ny = nz = 0.0
    for j in range(n):
        i = n - 1 - j
        g, k, o = 3 + JOINT * i, MOVED * i, f + WRENCH * i
        c, s = moved[k], moved[k + 1]
        fx, fy, fz = fx + forces[o], fy + forces[o + 1], fz + forces[o + 2]
        nx, ny, nz = nx + forces[o + 3], ny + forces[o + 4], nz + forces[o + 5]
        rx, ry, rz = geometry[g + 9], geometry[g + 10], geometry[g + 11]
        if geometry[g + 12] != 0.0:
            tau[i] = fz
            rx, ry = rx + geometry[g + 2] * u[i], ry + geometry[g + 5] * u[i]
            rz = rz + geometry[g + 8] * u[i]
        else:
            tau[i] = nz
        tx, ty = c * fx - s * fy, s * fx + c * fy
        px = geometry[g] * tx + geometry[g + 1] * ty + geometry[g + 2] * fz
        py = geometry[g + 3] * tx + geometry[g + 4] * ty + geometry[g + 5] * fz
        pz = geometry[g + 6] * tx + geometry[g + 7] * ty + geometry[g + 8] * fz
        tx, ty = c * nx - s * ny, s * nx + c * ny
        mx = geometry[g] * tx + geometry[g + 1] * ty + geometry[g + 2] * nz
        my = geometry[g + 3] * tx + geometry[g + 4] * ty + geometry[g + 5] * nz
        mz = geometry[g + 6] * tx + geometry[g + 7] * ty + geometry[g + 8] * nz
        fx, fy, fz = px, py, pz
        nx = mx + ry * pz - rz * py
        ny = my + rz * px - rx * pz
        nz = mz + rx * py - ry * px


@njit(cache=True)
def joint_torques(n: int, geometry: Any, inertia: Any, u: Any, tau: Any, kept: Any) -> None:
    """One sample.

    Args:
        n: number of joints.
        geometry: gravity (3), then `JOINT` reals a joint.
        inertia: `BODY` reals a link.
        u: q, q̇, q̈, each (n,), one after the other.
        tau: joint torques (forces of sliding joints), (n,), filled.
        kept: working memory, `KEPT` reals a joint.
    """
    outwards(n, geometry, u, kept)
    for i in range(n):
        wrench(i, inertia, BODY * i, kept, kept, MOVED * n + WRENCH * i)
    inwards(n, geometry, u, kept, kept, MOVED * n, tau)
