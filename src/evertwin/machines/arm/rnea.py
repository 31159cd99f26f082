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
_KEPT = 8


@njit(cache=True)
def joint_torques(n: int, geometry: Any, inertia: Any, u: Any, tau: Any, kept: Any) -> None:
    """One sample.

    Args:
        n: number of joints.
        geometry: gravity (3), then `JOINT` reals a joint.
        inertia: `BODY` reals a link.
        u: q, q̇, q̈, each (n,), one after the other.
        tau: joint torques (forces of sliding joints), (n,), filled.
        kept: working memory, 8 n reals.
    """
    # longer than the budget: one pass out and one back, in scalars so that nothing is allocated.
    wx = wy = wz = dx = dy = dz = 0.0
    ax, ay, az = -geometry[0], -geometry[1], -geometry[2]
    for i in range(n):
        g, b, k = 3 + JOINT * i, BODY * i, _KEPT * i
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
        tx, ty, tz = (
            e0 * px + e3 * py + e6 * pz,
            e1 * px + e4 * py + e7 * pz,
            e2 * px + e5 * py + e8 * pz,
        )
        ax, ay, az = c * tx + s * ty, c * ty - s * tx, tz
        tx, ty, tz = (
            e0 * wx + e3 * wy + e6 * wz,
            e1 * wx + e4 * wy + e7 * wz,
            e2 * wx + e5 * wy + e8 * wz,
        )
        wx, wy, wz = c * tx + s * ty, c * ty - s * tx, tz
        tx, ty, tz = (
            e0 * dx + e3 * dy + e6 * dz,
            e1 * dx + e4 * dy + e7 * dz,
            e2 * dx + e5 * dy + e8 * dz,
        )
        dx, dy, dz = c * tx + s * ty, c * ty - s * tx, tz
        if slides:
            ax, ay, az = ax + 2.0 * wy * v, ay - 2.0 * wx * v, az + acc
        else:
            dx, dy, dz = dx + wy * v, dy - wx * v, dz + acc
            wz += v
        m, hx, hy, hz = inertia[b], inertia[b + 1], inertia[b + 2], inertia[b + 3]
        xx, xy, yy = inertia[b + 4], inertia[b + 5], inertia[b + 6]
        xz, yz, zz = inertia[b + 7], inertia[b + 8], inertia[b + 9]
        # Force m·a + dw × h + w × (w × h) and moment I·dw + w × I·w + h × a at the origin.
        tx, ty, tz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
        kept[k] = c
        kept[k + 1] = s
        kept[k + 2] = m * ax + dy * hz - dz * hy + wy * tz - wz * ty
        kept[k + 3] = m * ay + dz * hx - dx * hz + wz * tx - wx * tz
        kept[k + 4] = m * az + dx * hy - dy * hx + wx * ty - wy * tx
        lx, ly = xx * wx + xy * wy + xz * wz, xy * wx + yy * wy + yz * wz
        lz = xz * wx + yz * wy + zz * wz
        kept[k + 5] = xx * dx + xy * dy + xz * dz + wy * lz - wz * ly + hy * az - hz * ay
        kept[k + 6] = xy * dx + yy * dy + yz * dz + wz * lx - wx * lz + hz * ax - hx * az
        kept[k + 7] = xz * dx + yz * dy + zz * dz + wx * ly - wy * lx + hx * ay - hy * ax
    fx = fy = fz = nx = ny = nz = 0.0
    for j in range(n):
        i = n - 1 - j
        g, k = 3 + JOINT * i, _KEPT * i
        c, s = kept[k], kept[k + 1]
        fx, fy, fz = fx + kept[k + 2], fy + kept[k + 3], fz + kept[k + 4]
        nx, ny, nz = nx + kept[k + 5], ny + kept[k + 6], nz + kept[k + 7]
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
