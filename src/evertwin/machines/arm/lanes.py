"""Inverse dynamics and friction switches of many rows at once, for the compiler to vectorise.

The same recursion as `evertwin.machines.arm.rnea`, joint by joint over `W` rows side by side: each
loop over rows is free of branches and calls and touches two arrays at constant distances, so that
it becomes wide machine instructions (0.05 µs a row for six joints instead of 0.24). Sine, cosine
and tanh are therefore polynomials (Taylor and minimax, after Cody and Waite 1980), exact to a few
units in the last place; angles up to 10⁵ rad. Rows do not know of each other: where rows are cut
changes no bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.machines.arm.rnea import BODY, JOINT
from evertwin.machines.friction.kernel import switch

W = 32
"""Rows side by side."""
_Q, _V, _A = 0, W, 2 * W
"""Places of position, speed and acceleration in ``s``, then of the frame's nine numbers."""
_WX, _WY, _WZ, _DX, _DY, _DZ, _AX, _AY, _AZ = (W * j for j in range(3, 12))
_STATE = 12 * W
_C, _S, _FX, _FY, _FZ, _NX, _NY, _NZ = (W * j for j in range(8))
"""Places of a joint's cosine, sine, force and moment in ``kept``."""
_KEPT = 8 * W


@njit(cache=True, inline="always")
def sine(x: float) -> tuple[float, float]:
    """(sin x, cos x) without a branch."""
    quarter = math.floor(x * 0.6366197723675814 + 0.5)
    r = x - quarter * 1.57079632673412561417
    r -= quarter * 6.07710050630396597660e-11
    r -= quarter * 2.02226624879595063154e-21
    z = r * r
    a = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155e-10)
    a = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * a)
    sine = r + r * z * (-1.66666666666666324348e-01 + z * a)
    b = 2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
    b = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * b)
    b = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * b)
    cosine = 1.0 - 0.5 * z + z * z * b
    m = quarter - 4.0 * math.floor(quarter * 0.25)
    odd = (m == 1.0) or (m == 3.0)
    first = cosine if odd else sine
    second = sine if odd else cosine
    return (-first if m >= 2.0 else first), (-second if (m == 1.0 or m == 2.0) else second)


@njit(cache=True, inline="always", error_model="numpy")
def _tanh(x: float) -> float:
    """(1 − e)/(1 + e) with e = exp(−2|x|) = exp(−|x|/32)⁶⁴; ±1 beyond 20."""
    r = -0.03125 * min(abs(x), 20.0)
    e = 1.0 / 20922789888000.0 + r / 355687428096000.0
    e = 1.0 / 87178291200.0 + r * (1.0 / 1307674368000.0 + r * e)
    e = 1.0 / 479001600.0 + r * (1.0 / 6227020800.0 + r * e)
    e = 1.0 / 3628800.0 + r * (1.0 / 39916800.0 + r * e)
    e = 1.0 / 40320.0 + r * (1.0 / 362880.0 + r * e)
    e = 1.0 / 720.0 + r * (1.0 / 5040.0 + r * e)
    e = 1.0 / 24.0 + r * (1.0 / 120.0 + r * e)
    e = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * e)))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    t = (1.0 - e) / (1.0 + e)
    return -t if x < 0.0 else t


@njit(cache=True)
def _outwards(g: Any, b: Any, s: Any, kept: Any) -> None:
    """One joint from the base: the frame's motion, then the link's force and moment."""
    # longer than the budget: one thought in scalars; see `joint_torques`, whose lines these are.
    e0, e1, e2, e3, e4, e5 = g[0], g[1], g[2], g[3], g[4], g[5]
    e6, e7, e8, r0, r1, r2 = g[6], g[7], g[8], g[9], g[10], g[11]
    m, hx, hy, hz = b[0], b[1], b[2], b[3]
    xx, xy, yy, xz, yz, zz = b[4], b[5], b[6], b[7], b[8], b[9]
    slide, turn = g[12], 1.0 - g[12]
    for i in range(W):
        q, v, acc = s[_Q + i], s[_V + i], s[_A + i]
        sn, c = sine(turn * q)
        rx, ry, rz = r0 + slide * e2 * q, r1 + slide * e5 * q, r2 + slide * e8 * q
        wx, wy, wz = s[_WX + i], s[_WY + i], s[_WZ + i]
        dx, dy, dz = s[_DX + i], s[_DY + i], s[_DZ + i]
        ax, ay, az = s[_AX + i], s[_AY + i], s[_AZ + i]
        tx, ty, tz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
        px = ax + dy * rz - dz * ry + wy * tz - wz * ty
        py = ay + dz * rx - dx * rz + wz * tx - wx * tz
        pz = az + dx * ry - dy * rx + wx * ty - wy * tx
        tx, ty = e0 * px + e3 * py + e6 * pz, e1 * px + e4 * py + e7 * pz
        az = e2 * px + e5 * py + e8 * pz
        ax, ay = c * tx + sn * ty, c * ty - sn * tx
        tx, ty = e0 * wx + e3 * wy + e6 * wz, e1 * wx + e4 * wy + e7 * wz
        wz = e2 * wx + e5 * wy + e8 * wz
        wx, wy = c * tx + sn * ty, c * ty - sn * tx
        tx, ty = e0 * dx + e3 * dy + e6 * dz, e1 * dx + e4 * dy + e7 * dz
        dz = e2 * dx + e5 * dy + e8 * dz + turn * acc
        dx, dy = c * tx + sn * ty + turn * wy * v, c * ty - sn * tx - turn * wx * v
        ax, ay = ax + slide * 2.0 * wy * v, ay - slide * 2.0 * wx * v
        az, wz = az + slide * acc, wz + turn * v
        s[_WX + i], s[_WY + i], s[_WZ + i] = wx, wy, wz
        s[_DX + i], s[_DY + i], s[_DZ + i] = dx, dy, dz
        s[_AX + i], s[_AY + i], s[_AZ + i] = ax, ay, az
        tx, ty, tz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
        kept[_C + i], kept[_S + i] = c, sn
        kept[_FX + i] = m * ax + dy * hz - dz * hy + wy * tz - wz * ty
        kept[_FY + i] = m * ay + dz * hx - dx * hz + wz * tx - wx * tz
        kept[_FZ + i] = m * az + dx * hy - dy * hx + wx * ty - wy * tx
        lx, ly = xx * wx + xy * wy + xz * wz, xy * wx + yy * wy + yz * wz
        lz = xz * wx + yz * wy + zz * wz
        kept[_NX + i] = xx * dx + xy * dy + xz * dz + wy * lz - wz * ly + hy * az - hz * ay
        kept[_NY + i] = xy * dx + yy * dy + yz * dz + wz * lx - wx * lz + hz * ax - hx * az
        kept[_NZ + i] = xz * dx + yz * dy + zz * dz + wx * ly - wy * lx + hx * ay - hy * ax


@njit(cache=True)
def _inwards(g: Any, s: Any, kept: Any, tau: Any) -> None:
    """One joint from the tip: its torque, then what it passes on; ``s`` holds force and moment."""
    e0, e1, e2, e3, e4, e5 = g[0], g[1], g[2], g[3], g[4], g[5]
    e6, e7, e8, r0, r1, r2 = g[6], g[7], g[8], g[9], g[10], g[11]
    slide, turn = g[12], 1.0 - g[12]
    for i in range(W):
        c, sn, q = kept[_C + i], kept[_S + i], s[_Q + i]
        fx, fy, fz = (
            s[_WX + i] + kept[_FX + i],
            s[_WY + i] + kept[_FY + i],
            s[_WZ + i] + kept[_FZ + i],
        )
        nx, ny, nz = (
            s[_DX + i] + kept[_NX + i],
            s[_DY + i] + kept[_NY + i],
            s[_DZ + i] + kept[_NZ + i],
        )
        tau[i] = slide * fz + turn * nz
        rx, ry, rz = r0 + slide * e2 * q, r1 + slide * e5 * q, r2 + slide * e8 * q
        tx, ty = c * fx - sn * fy, sn * fx + c * fy
        px, py = e0 * tx + e1 * ty + e2 * fz, e3 * tx + e4 * ty + e5 * fz
        pz = e6 * tx + e7 * ty + e8 * fz
        tx, ty = c * nx - sn * ny, sn * nx + c * ny
        s[_WX + i], s[_WY + i], s[_WZ + i] = px, py, pz
        s[_DX + i] = e0 * tx + e1 * ty + e2 * nz + ry * pz - rz * py
        s[_DY + i] = e3 * tx + e4 * ty + e5 * nz + rz * px - rx * pz
        s[_DZ + i] = e6 * tx + e7 * ty + e8 * nz + rx * py - ry * px


@njit(cache=True)
def batch(geometry: Any, inertia: Any, u: Any) -> Any:
    """Joint torques of every row of ``u``, (rows, 3 n) to (rows, n)."""
    rows, n = u.shape[0], u.shape[1] // 3
    out = np.empty((rows, n))
    s, kept, tau = np.zeros(_STATE), np.zeros(_KEPT * n), np.zeros(W)
    for first in range(0, rows, W):
        m = min(W, rows - first)
        s[_WX:_AX] = 0.0
        s[_AX:_AY], s[_AY:_AZ], s[_AZ:] = -geometry[0], -geometry[1], -geometry[2]
        for j in range(n):
            g, b, k = 3 + JOINT * j, BODY * j, _KEPT * j
            for i in range(m):
                s[_Q + i], s[_V + i] = u[first + i, j], u[first + i, n + j]
                s[_A + i] = u[first + i, 2 * n + j]
            _outwards(geometry[g : g + JOINT], inertia[b : b + BODY], s, kept[k : k + _KEPT])
        s[_WX:_AX] = 0.0
        for back in range(n):
            j = n - 1 - back
            g, k = 3 + JOINT * j, _KEPT * j
            for i in range(m):
                s[_Q + i] = u[first + i, j]
            _inwards(geometry[g : g + JOINT], s, kept[k : k + _KEPT], tau)
            for i in range(m):
                out[first + i, j] = tau[i]
    return out


# NumPy's error model: a division that must raise is a branch.
@njit(cache=True, error_model="numpy")
def _smooth(v: Any, width: float, out: Any) -> None:
    for i in range(W):
        out[i] = _tanh(v[i] / width)


@njit(cache=True)
def switches(u: Any, places: Any, p: Any, standstill: Any) -> Any:
    """`evertwin.machines.friction.kernel.switch` of every row and joint, (rows, n).

    Args:
        u: rows of q, q̇, q̈, (rows, 3 n).
        places: where in ``p`` the width of each joint's tanh is, (n,); −1 for the sign outside
            ``standstill``, as with a width of 0.
    """
    rows, n = u.shape[0], u.shape[1] // 3
    out = np.empty((rows, n))
    v, t = np.zeros(W), np.zeros(W)
    for j in range(n):
        width = p[places[j]] if places[j] >= 0 else 0.0
        if not width > 0.0:
            for i in range(rows):
                out[i, j] = switch(u[i, n + j], 0.0, standstill[j])
            continue
        for first in range(0, rows, W):
            m = min(W, rows - first)
            for i in range(m):
                v[i] = u[first + i, n + j]
            _smooth(v, width, t)
            for i in range(m):
                out[first + i, j] = t[i]
    return out
