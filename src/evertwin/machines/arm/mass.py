"""Mass matrix of a serial arm by the composite rigid body algorithm, compiled.

Walker and Orin (1982), with a link's ten numbers as in `evertwin.machines.arm.rnea`. From the tip
inwards, what hangs on a joint is one body; moving a body into the parent's frame by the rotation
``R`` and the position ``r`` changes its numbers to

    m,   h' = R·h + m·r,   I' = R·I·Rᵀ + 2(r·Rh)·1 − Rh·rᵀ − r·Rhᵀ + m(r·r·1 − r·rᵀ)

A unit acceleration of a joint asks that body for a force and a moment; what every joint nearer the
base must hold of them is the joint's column of the matrix.

>>> import numpy as np
>>> from evertwin.machines.arm import Arm
>>> chain = Arm.of("ur5_like").chain
>>> M = np.empty((6, 6))
>>> mass_matrix(6, chain.geometry, chain.inertia, np.zeros(6), M, np.empty(24 * 6))
>>> bool((M == M.T).all()), bool(np.linalg.eigvalsh(M)[0] > 0.0)
(True, True)
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from evertwin.machines.arm.rnea import BODY, JOINT

KEPT = 24
"""Reals of working memory for each joint: rotation (9) and position (3) in the parent, body."""
_BODY = 12


@njit(cache=True)
def _placed(n: int, geometry: Any, inertia: Any, q: Any, kept: Any) -> None:
    """Where each frame is in its parent, and the bodies before anything hangs on them."""
    for i in range(n):
        g, k = 3 + JOINT * i, KEPT * i
        slides = geometry[g + 12] != 0.0
        c, s = (1.0, 0.0) if slides else (math.cos(q[i]), math.sin(q[i]))
        for row in range(3):
            a, b = geometry[g + 3 * row], geometry[g + 3 * row + 1]
            kept[k + 3 * row] = c * a + s * b
            kept[k + 3 * row + 1] = c * b - s * a
            kept[k + 3 * row + 2] = geometry[g + 3 * row + 2]
            kept[k + 9 + row] = geometry[g + 9 + row]
            if slides:
                kept[k + 9 + row] += q[i] * geometry[g + 3 * row + 2]
        for item in range(BODY):
            kept[k + _BODY + item] = inertia[BODY * i + item]


@njit(cache=True)
def _hang(kept: Any, k: int, to: int) -> None:
    """Adds the body of the joint at ``k``, in its parent's frame, to the parent's body."""
    e0, e1, e2 = kept[k], kept[k + 1], kept[k + 2]
    e3, e4, e5 = kept[k + 3], kept[k + 4], kept[k + 5]
    e6, e7, e8 = kept[k + 6], kept[k + 7], kept[k + 8]
    x, y, z = kept[k + 9], kept[k + 10], kept[k + 11]
    b, a = k + _BODY, to + _BODY
    m, h0, h1, h2 = kept[b], kept[b + 1], kept[b + 2], kept[b + 3]
    xx, xy, yy = kept[b + 4], kept[b + 5], kept[b + 6]
    xz, yz, zz = kept[b + 7], kept[b + 8], kept[b + 9]
    hx = e0 * h0 + e1 * h1 + e2 * h2
    hy = e3 * h0 + e4 * h1 + e5 * h2
    hz = e6 * h0 + e7 * h1 + e8 * h2
    # R·I, then its product with Rᵀ
    t0, t1, t2 = (
        e0 * xx + e1 * xy + e2 * xz,
        e0 * xy + e1 * yy + e2 * yz,
        e0 * xz + e1 * yz + e2 * zz,
    )
    t3, t4, t5 = (
        e3 * xx + e4 * xy + e5 * xz,
        e3 * xy + e4 * yy + e5 * yz,
        e3 * xz + e4 * yz + e5 * zz,
    )
    t6, t7, t8 = (
        e6 * xx + e7 * xy + e8 * xz,
        e6 * xy + e7 * yy + e8 * yz,
        e6 * xz + e7 * yz + e8 * zz,
    )
    twice = 2.0 * (x * hx + y * hy + z * hz) + m * (x * x + y * y + z * z)
    kept[a] += m
    kept[a + 1] += hx + m * x
    kept[a + 2] += hy + m * y
    kept[a + 3] += hz + m * z
    kept[a + 4] += t0 * e0 + t1 * e1 + t2 * e2 + twice - 2.0 * hx * x - m * x * x
    kept[a + 5] += t0 * e3 + t1 * e4 + t2 * e5 - hx * y - x * hy - m * x * y
    kept[a + 6] += t3 * e3 + t4 * e4 + t5 * e5 + twice - 2.0 * hy * y - m * y * y
    kept[a + 7] += t0 * e6 + t1 * e7 + t2 * e8 - hx * z - x * hz - m * x * z
    kept[a + 8] += t3 * e6 + t4 * e7 + t5 * e8 - hy * z - y * hz - m * y * z
    kept[a + 9] += t6 * e6 + t7 * e7 + t8 * e8 + twice - 2.0 * hz * z - m * z * z


@njit(cache=True)
def mass_matrix(n: int, geometry: Any, inertia: Any, q: Any, out: Any, kept: Any) -> None:
    """The mass matrix at one posture.

    Args:
        n: number of joints.
        geometry: gravity (3), then `JOINT` reals a joint.
        inertia: `BODY` reals a link.
        q: joint positions, (n,) or more.
        out: filled, (n, n).
        kept: working memory, `KEPT` n reals.
    """
    _placed(n, geometry, inertia, q, kept)
    for back in range(n):
        j = n - 1 - back
        k = KEPT * j
        b = k + _BODY
        slides = geometry[3 + JOINT * j + 12] != 0.0
        m, h0, h1 = kept[b], kept[b + 1], kept[b + 2]
        if slides:
            f0, f1, f2, n0, n1, n2 = 0.0, 0.0, m, h1, -h0, 0.0
        else:
            f0, f1, f2, n0, n1, n2 = -h1, h0, 0.0, kept[b + 7], kept[b + 8], kept[b + 9]
        out[j, j] = f2 if slides else n2
        for down in range(j):
            i = j - 1 - down
            a = KEPT * (i + 1)
            x, y, z = kept[a + 9], kept[a + 10], kept[a + 11]
            f0, f1, f2 = (
                kept[a] * f0 + kept[a + 1] * f1 + kept[a + 2] * f2,
                kept[a + 3] * f0 + kept[a + 4] * f1 + kept[a + 5] * f2,
                kept[a + 6] * f0 + kept[a + 7] * f1 + kept[a + 8] * f2,
            )
            n0, n1, n2 = (
                kept[a] * n0 + kept[a + 1] * n1 + kept[a + 2] * n2 + y * f2 - z * f1,
                kept[a + 3] * n0 + kept[a + 4] * n1 + kept[a + 5] * n2 + z * f0 - x * f2,
                kept[a + 6] * n0 + kept[a + 7] * n1 + kept[a + 8] * n2 + x * f1 - y * f0,
            )
            out[i, j] = f2 if geometry[3 + JOINT * i + 12] != 0.0 else n2
            out[j, i] = out[i, j]
        if j > 0:
            _hang(kept, k, KEPT * (j - 1))
